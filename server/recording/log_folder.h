#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "mcap/file_calls.h"
#include "sensing/core/result.h"
#include "server/recording/log_order.h"

namespace taclink::server {

/// A log in the folder. While it is written its file has ".part" behind its name.
struct LogFileEntry {
  std::string name;
  uint64_t bytes = 0;
  bool open = false;
};

/// The folder that the server's logs are in. Holds no state: any thread, any number of objects.
class LogFolder {
 public:
  /// `calls` must outlive it: what it asks of the system while a log is written.
  explicit LogFolder(std::string path, mcap::FileCalls& calls = mcap::FileCalls::System())
      : path_(std::move(path)), calls_(calls) {}

  /// Makes the folder, for owner and group alone, if it is missing and tries to write. Errors:
  /// kPermissionDenied, kUnavailable.
  Result<void> Prepare() const;
  /// Whether a log could be begun there, without trying. Errors: as Prepare.
  Result<void> CheckWritable() const;
  bool Exists() const;
  const std::string& path() const { return path_; }
  mcap::FileCalls& calls() const { return calls_; }

  /// In the order in which they were begun (LogOrder). Before those are logs that were not recorded here,
  /// such as copied ones, by name.
  std::vector<LogFileEntry> List() const;
  /// Errors: kNotFound, kInvalidArgument (no name of a log).
  Result<LogFileEntry> Find(const std::string& name) const;
  /// Of the file, with ".part" while the log is open.
  std::string PathOf(const LogFileEntry& log) const;
  std::string FinalPath(const std::string& name) const { return path_ + "/" + name; }
  std::string PartPath(const std::string& name) const { return FinalPath(name) + ".part"; }
  /// From ".part" to the final name, safe from a power cut. Errors: the system's; a log that has the final
  /// name already is not replaced.
  Result<void> Finish(const std::string& name) const;
  /// Errors: kNotFound, kFailedPrecondition (it is being written, or may be), or the system's.
  Result<void> Delete(const std::string& name) const;
  /// A log of this name is about to be begun: it is the newest. Errors: kUnavailable.
  Result<void> Begin(const std::string& name) const { return LogOrder(path_, calls_).Append(name); }
  /// Deletes the oldest that are not open until all together are below `quota_bytes`. Returns their names.
  std::vector<std::string> EnforceQuota(uint64_t quota_bytes) const;
  /// Free space for this user; 0: not known.
  uint64_t FreeBytes() const;

  /// Logs that are open: those that are being written, by this server or another, and those that a killed
  /// server has left so.
  std::vector<LogFileEntry> Unfinished() const;
  /// Makes a log whole that nobody writes any more: what is intact goes to a log under its final name, or
  /// NAME.recovered.mcap, if that is taken. Unless only a torn end is lost, the damaged log is kept as
  /// NAME.damaged.mcap. Returns what came of it, for people; none: it is being written (its file is locked),
  /// or another server has made it whole meanwhile. It stays untouched where the file system has no locks.
  std::optional<std::string> Recover(const std::string& name, const std::stop_token& stop = {}) const;

 private:
  /// All, in the order of List.
  std::vector<LogFileEntry> Files() const;
  /// The unfinished log was made whole. Returns where it is now, for people.
  std::string PutAside(const std::string& name, bool may_hold_more) const;

  const std::string path_;
  mcap::FileCalls& calls_;
};

/// "PREFIX-20261122T120137Z-001.mcap".
std::string LogName(const std::string& prefix, int64_t utc_ns, int part);
/// Letters, digits, '-', '_' and '.', ending with ".mcap", not beginning with '.'.
bool IsLogName(const std::string& name);

}  // namespace taclink::server

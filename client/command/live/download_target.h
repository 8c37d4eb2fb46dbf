#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink::command {

/// Where a download goes: a regular file, which may hold the beginning of the same log; or standard output, a
/// pipe or a device, which take everything from the first byte on. A file that holds anything else is not
/// changed: the end of what it has is fetched again and compared. One thread.
class DownloadTarget {
 public:
  /// "-": standard output. Ignores SIGPIPE from now on. Waits for the reader of a pipe, which a line on
  /// stderr says. Errors: kInvalidArgument (a folder, a socket, a terminal), kPermissionDenied, kNotFound,
  /// kUnavailable.
  static Result<DownloadTarget> Open(const std::string& path);
  ~DownloadTarget();
  DownloadTarget(DownloadTarget&& other) noexcept;
  DownloadTarget& operator=(DownloadTarget&&) = delete;

  /// Bytes that it had when it was opened; 0 if it can't be resumed.
  uint64_t there() const { return there_; }
  /// Where the download must begin: before there(), so that Receive can compare.
  uint64_t start() const { return there_ - std::min(there_, kOverlap); }
  uint64_t size() const { return there_ + written_; }
  bool can_resume() const { return can_resume_; }
  bool is_stdout() const { return path_ == "-"; }
  /// For messages.
  std::string name() const { return is_stdout() ? "standard output" : path_; }

  /// Takes the pieces of the log in sequence from start() on: compares those that the file has, appends the
  /// others. Errors: kFailedPrecondition (the file holds something else), kResourceExhausted (full),
  /// kInternal (a piece that does not follow), kUnavailable, with the system's reason.
  Result<void> Receive(std::string_view data, uint64_t offset);
  /// The log is complete. Errors: kFailedPrecondition (the file is longer than the log), kUnavailable.
  Result<void> Close();
  /// Removes a file that Open has made and to which nothing was written.
  void RemoveIfNew();

 private:
  explicit DownloadTarget(std::string path) : path_(std::move(path)) {}
  Error Failed(const std::string& doing, int number) const;
  Error HoldsSomethingElse() const;
  Result<void> Compare(std::string_view data, uint64_t offset) const;
  Result<void> Write(std::string_view data);

  static constexpr uint64_t kOverlap = 64 * 1024;

  std::string path_;
  int file_ = -1;
  bool is_new_ = false;
  bool can_resume_ = false;
  uint64_t there_ = 0, written_ = 0;
  uint64_t next_ = 0;  // offset in the log of the piece that Receive must get next
};

}  // namespace taclink::command

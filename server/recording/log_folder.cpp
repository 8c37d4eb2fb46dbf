#include "server/recording/log_folder.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include "mcap/file_sink.h"
#include "mcap/recover.h"
#include "server/recording/file_lock.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSuffix = ".mcap", kPart = ".part", kRecovering = ".recovering";

Error FromSystem(const std::string& what, const std::error_code& error) {
  const bool denied = error == std::errc::permission_denied || error == std::errc::operation_not_permitted ||
                      error == std::errc::read_only_file_system;
  return {denied ? ErrorCode::kPermissionDenied : ErrorCode::kUnavailable, what + ": " + error.message()};
}

/// Gives nothing more once it is to stop: a log can be of any size.
class StoppableSource final : public mcap::ByteSource {
 public:
  StoppableSource(const mcap::ByteSource& source, std::stop_token stop)
      : source_(source), stop_(std::move(stop)) {}
  uint64_t size() const override { return source_.size(); }
  Result<void> Read(uint64_t offset, std::span<std::byte> out) const override {
    if (stop_.stop_requested()) return Error{ErrorCode::kUnavailable, "stopped"};
    return source_.Read(offset, out);
  }

 private:
  const mcap::ByteSource& source_;
  const std::stop_token stop_;
};

// "arm-1.mcap" -> "arm-1.damaged.mcap".
std::string WithMark(const std::string& name, const std::string& mark) {
  return name.substr(0, name.size() - kSuffix.size()) + mark + std::string(kSuffix);
}

// A killed server or a power cut leaves a torn end, of which nothing more can be had. Of other damage a later
// attempt may save more.
bool MayHoldMore(const mcap::ScanReport& scan, uint64_t bytes) {
  const bool beside_the_end = std::any_of(scan.lost.begin(), scan.lost.end(), [bytes](const auto& range) {
    return range.offset + range.length < bytes;
  });
  return beside_the_end || scan.start_missing || 2 * scan.lost_bytes > bytes ||
         scan.dropped + scan.orphans + scan.damaged_attachments > 0;
}

Result<void> SyncFolder(mcap::FileCalls& calls, const std::string& path) {
  const int folder = calls.Open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC, 0);
  const bool synced = folder >= 0 && calls.SyncFolder(folder) == 0;
  const std::error_code error(errno, std::generic_category());
  if (folder >= 0) calls.Close(folder);
  if (!synced) return FromSystem(path, error);
  return {};
}

}  // namespace

std::string LogName(const std::string& prefix, int64_t utc_ns, int part) {
  // Not of a time point, which fmt 9 takes for one of the local time zone.
  const std::tm time = fmt::gmtime(static_cast<std::time_t>(utc_ns / 1'000'000'000));
  return fmt::format("{}-{:%Y%m%dT%H%M%SZ}-{:03}{}", prefix, time, part, kSuffix);
}

bool IsLogName(const std::string& name) {
  const auto good = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  return name.size() > kSuffix.size() && name.size() <= 200 && name.ends_with(kSuffix) &&
         !name.starts_with('.') && std::all_of(name.begin(), name.end(), good);
}

Result<void> LogFolder::Prepare() const {
  std::error_code error;
  if (fs::create_directories(path_, error))
    fs::permissions(path_, fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec, error);
  if (error) return FromSystem("recording.folder " + path_, error);
  const std::string probe = path_ + "/.taclink-" + std::to_string(::getpid());
  const int file = calls_.Open(probe, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  if (file < 0) return FromSystem("recording.folder " + path_, {errno, std::generic_category()});
  calls_.Close(file);
  fs::remove(probe, error);
  return {};
}

Result<void> LogFolder::CheckWritable() const {
  if (calls_.Access(path_, W_OK | X_OK) == 0) return {};
  return FromSystem("recording.folder " + path_, {errno, std::generic_category()});
}

bool LogFolder::Exists() const {
  std::error_code error;
  return fs::is_directory(path_, error);
}

std::vector<LogFileEntry> LogFolder::List() const {
  std::vector<LogFileEntry> logs = Files();
  // A log that is closed at this very moment may show twice, or an open one beside its recovered twin.
  logs.erase(
      std::unique(logs.begin(), logs.end(), [](const auto& a, const auto& b) { return a.name == b.name; }),
      logs.end());
  return logs;
}

std::vector<LogFileEntry> LogFolder::Files() const {
  std::vector<LogFileEntry> logs;
  std::error_code error;
  for (fs::directory_iterator at(path_, error), end; !error && at != end; at.increment(error)) {
    LogFileEntry log{.name = at->path().filename().string()};
    log.open = log.name.ends_with(kPart);
    if (log.open) log.name.resize(log.name.size() - kPart.size());
    std::error_code gone;
    // A link could lead out of the folder.
    if (at->symlink_status(gone).type() != fs::file_type::regular || !IsLogName(log.name)) continue;
    log.bytes = at->file_size(gone);
    if (!gone) logs.push_back(std::move(log));
  }
  const auto ranks = LogOrder(path_, calls_).Ranks();
  const auto rank = [&ranks](const LogFileEntry& log) {
    const auto at = ranks.find(log.name);
    return at == ranks.end() ? uint64_t{0} : at->second;
  };
  std::sort(logs.begin(), logs.end(), [&rank](const auto& a, const auto& b) {
    return std::tuple(rank(a), a.name, a.open) < std::tuple(rank(b), b.name, b.open);
  });
  return logs;
}

Result<LogFileEntry> LogFolder::Find(const std::string& name) const {
  if (!IsLogName(name))
    return Error{ErrorCode::kInvalidArgument,
                 "'" + name + "' is no name of a log; see 'taclink record list'"};
  for (const bool open : {false, true}) {
    LogFileEntry log{.name = name, .open = open};
    std::error_code gone;
    if (fs::symlink_status(PathOf(log), gone).type() != fs::file_type::regular) continue;
    log.bytes = fs::file_size(PathOf(log), gone);
    if (!gone) return log;
  }
  return Error{ErrorCode::kNotFound, "there is no log '" + name + "'; see 'taclink record list'"};
}

std::string LogFolder::PathOf(const LogFileEntry& log) const {
  return log.open ? PartPath(log.name) : FinalPath(log.name);
}

Result<void> LogFolder::Finish(const std::string& name) const {
  if (calls_.Rename(PartPath(name), FinalPath(name)) != 0)
    return FromSystem(PartPath(name), {errno, std::generic_category()});
  return SyncFolder(calls_, path_);
}

Result<void> LogFolder::Delete(const std::string& name) const {
  const auto log = Find(name);
  if (!log) return log.error();
  if (log->open && !FileLock::TryTake(PartPath(name), calls_))
    return Error{ErrorCode::kFailedPrecondition, name + " is being written; stop the recording first"};
  std::error_code error;
  fs::remove(PathOf(*log), error);
  if (error) return FromSystem(name, error);
  return {};
}

std::vector<std::string> LogFolder::EnforceQuota(uint64_t quota_bytes) const {
  const auto logs = List();
  uint64_t bytes = 0;
  for (const LogFileEntry& log : logs) bytes += log.bytes;
  std::vector<std::string> deleted;
  for (const LogFileEntry& log : logs) {
    if (bytes <= quota_bytes) break;
    if (log.open || !Delete(log.name)) continue;  // of open ones a later attempt may save something
    bytes -= log.bytes;
    deleted.push_back(log.name);
  }
  if (deleted.empty()) return deleted;
  LogOrder(path_, calls_).Compact([this] {
    std::set<std::string> existing;
    for (const LogFileEntry& log : List()) existing.insert(log.name);
    return existing;
  });
  return deleted;
}

uint64_t LogFolder::FreeBytes() const {
  // A folder that is made only when it is needed will be where the one above it is.
  std::error_code error;
  for (fs::path folder = path_; !folder.empty(); folder = folder.parent_path()) {
    const auto space = fs::space(folder, error);
    if (!error) return space.available;
    if (folder == folder.parent_path()) break;
  }
  return 0;
}

std::vector<LogFileEntry> LogFolder::Unfinished() const {
  std::vector<LogFileEntry> logs = Files();
  std::erase_if(logs, [](const LogFileEntry& log) { return !log.open; });
  return logs;
}

std::optional<std::string> LogFolder::Recover(const std::string& name, const std::stop_token& stop) const {
  const std::string part = PartPath(name), fresh = FinalPath(name) + std::string(kRecovering);
  std::error_code ignored;
  const auto lock = FileLock::TryTake(part, calls_);
  if (!lock && lock.error().code != ErrorCode::kUnavailable) return std::nullopt;
  if (!lock)
    return lock.error().message +
           ". It may be one that another server is writing, and stays as it is: if it is not, use 'taclink "
           "log recover'";
  fs::remove(fresh, ignored);  // of a recovery that was cut off
  const auto failed = [&](const Error& error) {
    fs::remove(fresh, ignored);
    return name + " was not closed and could not be made whole: " + error.message + "; it stays as " + part;
  };
  const auto source = mcap::FileSource::Open(part);
  if (!source) return failed(source.error());
  auto sink = mcap::FileSink::Create(fresh);
  if (!sink) return failed(sink.error());
  mcap::RecoverOptions options;
  options.writer.compression = mcap::Compression::kLz4;
  const auto report = mcap::Recover(StoppableSource(**source, stop), **sink, options);
  if (stop.stop_requested()) return failed({ErrorCode::kUnavailable, "the server stops"});
  if (!report) return failed(report.error());
  const mcap::Statistics& kept = report->written;
  const bool nothing = kept.message_count + kept.attachment_count + kept.metadata_count == 0;
  if (nothing && (*source)->size() > 0)
    return failed({ErrorCode::kInvalidArgument, "nothing in it is intact"});
  if (const auto synced = (*sink)->Sync(); !synced) return failed(synced.error());
  // Another log may have the name already.
  const std::string whole = fs::exists(FinalPath(name), ignored) ? WithMark(name, ".recovered") : name;
  if (calls_.Rename(fresh, FinalPath(whole)) != 0)
    return failed(FromSystem(fresh, {errno, std::generic_category()}));
  if (const auto synced = SyncFolder(calls_, path_); !synced) return failed(synced.error());
  std::string outcome = name + " was not closed; made whole";
  if (whole != name) outcome += fmt::format(" as {} (a log has its name)", whole);
  return outcome + ": " + report->scan.Text() + PutAside(name, MayHoldMore(report->scan, (*source)->size()));
}

std::string LogFolder::PutAside(const std::string& name, bool may_hold_more) const {
  const std::string part = PartPath(name), damaged = WithMark(name, ".damaged");
  std::error_code ignored;
  if (!may_hold_more) {
    fs::remove(part, ignored);
    return "";
  }
  if (calls_.Rename(part, FinalPath(damaged)) != 0) return "; the damaged log stays as " + part;
  static_cast<void>(Begin(damaged));  // else it is the first that gives way to the quota
  return fmt::format("; the damaged log is kept as {} ('taclink log recover --unverified' may save more)",
                     damaged);
}

}  // namespace taclink::server

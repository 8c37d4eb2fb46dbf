#include "server/recording/log_order.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <thread>
#include <vector>

#include "server/recording/file_lock.h"

namespace taclink::server {
namespace {

constexpr size_t kMostForgotten = 1000;  // names of deleted logs, before they are removed
constexpr off_t kMostBytes = off_t{16} << 20;
constexpr int kLockTries = 20;
constexpr std::chrono::milliseconds kLockPause{10};

Error OrderError(const std::string& path, const char* doing) {
  return {ErrorCode::kUnavailable, path + ": " + doing + ": " + std::generic_category().message(errno) +
                                       "; without it recording.quota_mb could delete the newest log first"};
}

// Keeps another server from compacting the file while this one appends. Whoever holds the lock does so for
// milliseconds; a suspended process is not waited for, since an appended line matters more.
void WaitForLock(const std::string& folder, mcap::FileCalls& calls, const auto& then) {
  for (int i = 0; i < kLockTries; ++i) {
    const auto lock = FileLock::TryTake(folder, calls);  // held during `then`
    if (lock || lock.error().code != ErrorCode::kFailedPrecondition) return then();
    std::this_thread::sleep_for(kLockPause);
  }
  then();
}

// Other programs may put anything there, such as a FIFO or a link to a device without an end.
bool IsUsable(mcap::FileCalls& calls, int file) {
  struct stat status{};
  return calls.Status(file, status) == 0 && S_ISREG(status.st_mode) && status.st_size <= kMostBytes;
}

int WriteWhole(mcap::FileCalls& calls, int file, std::string& text) {
  const iovec piece{.iov_base = text.data(), .iov_len = text.size()};
  ssize_t written = 0;
  do {
    written = calls.Write(file, &piece, 1);
  } while (written < 0 && errno == EINTR);
  if (written < 0) return -1;
  if (static_cast<size_t>(written) == text.size()) return 0;
  errno = ENOSPC;
  return -1;
}

}  // namespace

Result<void> LogOrder::Append(const std::string& log) const {
  // The first line feed ends a line that a power cut has torn; empty lines are nothing. One write, so that
  // the lines of two servers do not mix.
  std::string line = "\n" + log + "\n";
  Result<void> appended;
  WaitForLock(folder_, calls_, [&] {
    const int file = calls_.Open(
        path_, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY, 0640);
    if (file < 0) {
      appended = OrderError(path_, "cannot be opened");
      return;
    }
    if (!IsUsable(calls_, file)) {
      appended = Error{ErrorCode::kUnavailable, path_ + " is no regular file of at most 16 MiB; remove it"};
      calls_.Close(file);
      return;
    }
    if (WriteWhole(calls_, file, line) != 0) {
      appended = OrderError(path_, "cannot be written");
    } else if (calls_.Sync(file) != 0) {
      appended = OrderError(path_, "cannot be synced");
    }
    calls_.Close(file);
  });
  return appended;
}

std::map<std::string, uint64_t> LogOrder::Ranks() const {
  std::map<std::string, uint64_t> ranks;
  struct stat status{};
  if (calls_.Status(path_, status) != 0 || !S_ISREG(status.st_mode) || status.st_size > kMostBytes)
    return ranks;
  std::ifstream file(path_);
  uint64_t rank = 0;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty() && !file.eof()) ranks[line] = ++rank;  // without a line feed it is torn
  }
  return ranks;
}

void LogOrder::Compact(const std::function<std::set<std::string>()>& existing) const {
  const auto lock = FileLock::TryTake(folder_, calls_);
  if (!lock) return;
  std::vector<std::pair<uint64_t, std::string>> kept;
  const auto ranks = Ranks();
  const auto kept_names = existing();
  for (const auto& [name, rank] : ranks) {
    if (kept_names.contains(name)) kept.emplace_back(rank, name);
  }
  if (ranks.size() - kept.size() < kMostForgotten) return;
  std::sort(kept.begin(), kept.end());
  const std::string fresh = path_ + ".new";
  {
    std::ofstream file(fresh);
    for (const auto& [rank, name] : kept) file << name << '\n';
    file.close();
    if (!file) return;
  }
  std::error_code ignored;
  if (const int file = calls_.Open(fresh, O_WRONLY | O_CLOEXEC, 0); file >= 0) {
    const bool synced = calls_.Sync(file) == 0;
    calls_.Close(file);
    if (synced) return std::filesystem::rename(fresh, path_, ignored);
  }
  std::filesystem::remove(fresh, ignored);
}

}  // namespace taclink::server

#include "server/recording/file_lock.h"

#include <fcntl.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace taclink::server {

Result<FileLock> FileLock::TryTake(const std::string& path, mcap::FileCalls& calls) {
  const auto failed = [&path](const char* doing) {
    const int number = errno;
    const std::string what = path + ": " + doing + ": " + std::generic_category().message(number);
    if (number == EWOULDBLOCK) return Error{ErrorCode::kFailedPrecondition, what};
    return Error{number == ENOENT ? ErrorCode::kNotFound : ErrorCode::kUnavailable, what};
  };
  const int file = calls.Open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK, 0);
  if (file < 0) return failed("cannot be opened");
  FileLock lock(file, calls);
  while (calls.Lock(file) != 0) {
    if (errno != EINTR) return failed("cannot be locked");
  }
  // Who held the lock before may have removed or renamed the file.
  struct stat mine{}, there{};
  if (calls.Status(file, mine) != 0 || calls.Status(path, there) != 0) return failed("cannot be examined");
  if (mine.st_dev == there.st_dev && mine.st_ino == there.st_ino) return lock;
  return Error{ErrorCode::kNotFound, path + ": another file has taken its place"};
}

FileLock::~FileLock() {
  if (file_ >= 0) calls_->Close(file_);
}

FileLock::FileLock(FileLock&& other) noexcept : file_(std::exchange(other.file_, -1)), calls_(other.calls_) {}

}  // namespace taclink::server

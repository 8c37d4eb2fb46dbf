#include "wire/mcap/file_sink.h"

#include <fcntl.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

namespace taclink::mcap {
namespace {

constexpr size_t kPiecesAtOnce = 256;  // POSIX asks for 16, Linux takes 1024

Error FileError(int number, const std::string& doing, const std::string& path) {
  const std::string what = doing + " '" + path + "': " + std::generic_category().message(number);
  switch (number) {
    case EEXIST:
      return {ErrorCode::kFailedPrecondition, what + "; choose another name or move the old file away"};
    case ENOENT:
    case ENOTDIR:
      return {ErrorCode::kNotFound, what + "; create its folder"};
    case EACCES:
    case EPERM:
    case EROFS:
      return {ErrorCode::kPermissionDenied, what + "; give the folder to the user of this process"};
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return {ErrorCode::kResourceExhausted, what + "; free space or log to another disk"};
    default:
      return {ErrorCode::kUnavailable, what + "; check the disk"};
  }
}

/// Takes `written` bytes off the front of `pieces`; those that are done are left out.
std::span<iovec> Advance(std::span<iovec> pieces, size_t written) {
  while (!pieces.empty() && written >= pieces.front().iov_len) {
    written -= pieces.front().iov_len;
    pieces = pieces.subspan(1);
  }
  if (!pieces.empty()) {
    pieces.front().iov_base = static_cast<std::byte*>(pieces.front().iov_base) + written;
    pieces.front().iov_len -= written;
  }
  return pieces;
}

/// Returns the system's error number, 0: all is written.
int WriteAll(int file, std::span<iovec> pieces) {
  for (pieces = Advance(pieces, 0); !pieces.empty();) {
    const ssize_t written = writev(file, pieces.data(), static_cast<int>(pieces.size()));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    if (written == 0) return ENOSPC;
    pieces = Advance(pieces, static_cast<size_t>(written));
  }
  return 0;
}

}  // namespace

Result<std::unique_ptr<FileSink>> FileSink::Create(const std::string& path) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file < 0) return FileError(errno, "can't create", path);
  return std::unique_ptr<FileSink>(new FileSink(path, file));
}

FileSink::~FileSink() {
  close(file_);
}

Result<void> FileSink::Append(std::span<const Bytes> pieces) {
  uint64_t total = 0;
  std::array<iovec, kPiecesAtOnce> vectors{};
  while (!pieces.empty()) {
    const size_t count = std::min(pieces.size(), vectors.size());
    for (size_t i = 0; i < count; ++i) {
      vectors[i] = {.iov_base = const_cast<std::byte*>(pieces[i].data()), .iov_len = pieces[i].size()};
      total += pieces[i].size();
    }
    if (const int number = WriteAll(file_, std::span(vectors).first(count)); number != 0) {
      return FileError(number, "can't write to", path_);
    }
    pieces = pieces.subspan(count);
  }
  position_ += total;
  return {};
}

Result<void> FileSink::Sync() {
  while (fdatasync(file_) != 0) {
    if (errno != EINTR) return FileError(errno, "can't sync", path_);
  }
  return {};
}

Result<void> FileSink::Truncate(uint64_t position) {
  const auto offset = static_cast<off_t>(position);
  while (ftruncate(file_, offset) != 0) {
    if (errno != EINTR) return FileError(errno, "can't cut the torn end off", path_);
  }
  if (lseek(file_, offset, SEEK_SET) < 0) return FileError(errno, "can't go back in", path_);
  position_ = position;
  return {};
}

}  // namespace taclink::mcap

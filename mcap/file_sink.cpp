#include "mcap/file_sink.h"

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
    case EWOULDBLOCK:  // a new file that another program has locked first
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
    case EMFILE:
    case ENFILE:
      return {ErrorCode::kUnavailable, what + "; raise LimitNOFILE, or end some clients"};
    default:
      return {ErrorCode::kUnavailable, what + "; check the disk"};
  }
}

Error CutError(const std::string& path) {
  return {ErrorCode::kUnavailable, "can't write to '" + path + "': another program has cut it"};
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
int WriteAll(FileCalls& calls, int file, std::span<iovec> pieces) {
  for (pieces = Advance(pieces, 0); !pieces.empty();) {
    const ssize_t written = calls.Write(file, pieces.data(), static_cast<int>(pieces.size()));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    if (written == 0) return ENOSPC;
    pieces = Advance(pieces, static_cast<size_t>(written));
  }
  return 0;
}

}  // namespace

Result<std::unique_ptr<FileSink>> FileSink::Create(const std::string& path, FileCalls& calls) {
  const int file = calls.Open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640);
  if (file < 0) return FileError(errno, "can't create", path);
  while (calls.Lock(file) != 0) {
    if (errno == EINTR) continue;
    if (errno != EWOULDBLOCK) break;  // a file system without locks
    calls.Close(file);
    return FileError(EWOULDBLOCK, "can't lock", path);
  }
  return std::unique_ptr<FileSink>(new FileSink(path, file, calls));
}

FileSink::~FileSink() {
  calls_.Close(file_);
}

Result<void> FileSink::Append(std::span<const Bytes> pieces) {
  // Else what follows would lie behind a hole.
  if (IsCut()) return CutError(path_);
  uint64_t total = 0;
  std::array<iovec, kPiecesAtOnce> vectors{};
  while (!pieces.empty()) {
    const size_t count = std::min(pieces.size(), vectors.size());
    for (size_t i = 0; i < count; ++i) {
      vectors[i] = {.iov_base = const_cast<std::byte*>(pieces[i].data()), .iov_len = pieces[i].size()};
      total += pieces[i].size();
    }
    if (const int number = WriteAll(calls_, file_, std::span(vectors).first(count)); number != 0) {
      return FileError(number, "can't write to", path_);
    }
    pieces = pieces.subspan(count);
  }
  position_ += total;
  return {};
}

Result<void> FileSink::Sync() {
  while (calls_.Sync(file_) != 0) {
    if (errno != EINTR) return FileError(errno, "can't sync", path_);
  }
  return {};
}

Result<void> FileSink::Truncate(uint64_t position) {
  if (IsCut()) return CutError(path_);
  const auto offset = static_cast<off_t>(position);
  while (calls_.Truncate(file_, offset) != 0) {
    if (errno != EINTR) return FileError(errno, "can't cut the torn end off", path_);
  }
  if (calls_.Seek(file_, offset) < 0) return FileError(errno, "can't go back in", path_);
  position_ = position;
  return {};
}

bool FileSink::IsCut() const {
  struct stat mine{};
  return calls_.Status(file_, mine) == 0 && static_cast<uint64_t>(mine.st_size) < position_;
}

// What the system does not tell is taken for there: reading and writing say what is wrong with it.
FileSink::Place FileSink::WhereItIs() const {
  struct stat mine{}, there{};
  if (calls_.Status(file_, mine) != 0) return Place::kThere;
  if (mine.st_nlink == 0) return Place::kNowhere;
  if (static_cast<uint64_t>(mine.st_size) < position_) return Place::kCut;
  if (calls_.Status(path_, there) != 0)
    return errno == ENOENT || errno == ENOTDIR ? Place::kElsewhere : Place::kThere;
  return mine.st_dev == there.st_dev && mine.st_ino == there.st_ino ? Place::kThere : Place::kElsewhere;
}

}  // namespace taclink::mcap

#include "mcap/byte_source.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "sensing/core/file_kind.h"

namespace taclink::mcap {
namespace {

Error FileError(int number, const std::string& doing, const std::string& path) {
  const std::string what = doing + " '" + path + "': " + std::generic_category().message(number);
  if (number == ENOENT || number == ENOTDIR) return {ErrorCode::kNotFound, what + "; check the name"};
  if (number == EACCES) return {ErrorCode::kPermissionDenied, what + "; make it readable"};
  return {ErrorCode::kUnavailable, what + "; check the disk"};
}

Error NotRegular(const std::string& path, mode_t mode) {
  const char* advice =
      S_ISDIR(mode) ? "name a log in it" : "logs are read at random places: copy it to a regular file first";
  return {ErrorCode::kInvalidArgument, "can't read '" + path + "': it is " + FileKind(mode) + "; " + advice};
}

Error PastEnd(uint64_t offset, size_t bytes, uint64_t size) {
  return {ErrorCode::kInvalidArgument, "offset " + std::to_string(offset) + ": " + std::to_string(bytes) +
                                           " bytes reach past the end at " + std::to_string(size)};
}

}  // namespace

Result<void> MemorySource::Read(uint64_t offset, std::span<std::byte> out) const {
  if (offset > size() || out.size() > size() - offset) return PastEnd(offset, out.size(), size());
  std::copy_n(bytes_.begin() + static_cast<ptrdiff_t>(offset), out.size(), out.begin());
  return {};
}

Result<std::unique_ptr<FileSource>> FileSource::Open(const std::string& path) {
  struct stat status{};
  // Before it is opened: opening acts on some devices, and sockets can't be opened.
  if (stat(path.c_str(), &status) != 0) return FileError(errno, "can't open", path);
  if (!S_ISREG(status.st_mode)) return NotRegular(path, status.st_mode);
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe does not keep it waiting
  if (file < 0) return FileError(errno, "can't open", path);
  const int number = fstat(file, &status) != 0 ? errno : 0;
  if (number != 0 || !S_ISREG(status.st_mode)) {  // replaced meanwhile
    close(file);
    return number != 0 ? FileError(number, "can't read", path) : NotRegular(path, status.st_mode);
  }
  return std::unique_ptr<FileSource>(new FileSource(path, file, static_cast<uint64_t>(status.st_size)));
}

FileSource::~FileSource() {
  close(file_);
}

Result<void> FileSource::Read(uint64_t offset, std::span<std::byte> out) const {
  if (offset > size_ || out.size() > size_ - offset) return PastEnd(offset, out.size(), size_);
  while (!out.empty()) {
    const ssize_t got = pread(file_, out.data(), out.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return FileError(errno, "can't read", path_);
    if (got == 0) return PastEnd(offset, out.size(), offset);
    out = out.subspan(static_cast<size_t>(got));
    offset += static_cast<uint64_t>(got);
  }
  return {};
}

}  // namespace taclink::mcap

#include "sensing/core/read_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <limits>
#include <string_view>
#include <system_error>

#include "sensing/core/file_kind.h"

namespace taclink {

Error FileError(const std::string& path, int number) {
  const std::string what = path + " cannot be read (" + std::generic_category().message(number) + ")";
  switch (number) {
    case EMFILE:
    case ENFILE:
      return {ErrorCode::kUnavailable, what + "; raise LimitNOFILE, or close what has many files open"};
    case EAGAIN:
    case EINTR:
    case EIO:
    case ENOBUFS:
    case ENOMEM:
    case ESTALE:
    case ETIMEDOUT:
      return {ErrorCode::kUnavailable, what + "; see the machine's memory and disk"};
    case EACCES:
    case EPERM:
      return {ErrorCode::kPermissionDenied, what + "; see who may read it"};
    default:
      return {ErrorCode::kNotFound, what + "; check the path"};
  }
}

namespace {

class OpenFile {
 public:
  // Without waiting for who writes into a pipe.
  explicit OpenFile(const std::string& path)
      : number_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY)) {}
  ~OpenFile() {
    if (number_ >= 0) ::close(number_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  int number() const { return number_; }

 private:
  const int number_;
};

Error TooLarge(const std::string& path, uint64_t most_bytes) {
  return {ErrorCode::kInvalidArgument, path + ": is larger than " + std::to_string(most_bytes >> 20) +
                                           " MiB, the most that is read of such a file"};
}

Error NotRegular(const std::string& path, mode_t mode) {
  const char* advice = S_ISDIR(mode) ? "name a file in it" : "copy its content to one";
  return {ErrorCode::kInvalidArgument,
          path + ": is " + FileKind(mode) + ", and must be a regular file; " + advice};
}

// `most_size`: of the file, whatever is read of it.
Result<std::string> Read(const std::string& path, size_t bytes, uint64_t most_size) {
  struct stat status{};
  // Before it is opened: opening acts on some devices, and sockets can't be opened.
  if (::stat(path.c_str(), &status) != 0) return FileError(path, errno);
  if (!S_ISREG(status.st_mode)) return NotRegular(path, status.st_mode);
  const OpenFile file(path);
  if (file.number() < 0 || ::fstat(file.number(), &status) != 0) return FileError(path, errno);
  if (!S_ISREG(status.st_mode)) return NotRegular(path, status.st_mode);  // replaced meanwhile
  if (static_cast<uint64_t>(status.st_size) > most_size) return TooLarge(path, most_size);
  std::string out;
  constexpr size_t kBlock = size_t{1} << 16;
  while (out.size() < bytes) {
    const size_t before = out.size();
    out.resize(before + std::min(kBlock, bytes - before));
    const ssize_t got = ::read(file.number(), out.data() + before, out.size() - before);
    out.resize(before + static_cast<size_t>(std::max<ssize_t>(got, 0)));
    if (got < 0 && errno != EINTR) return FileError(path, errno);
    if (got == 0) break;
  }
  return out;
}

}  // namespace

Result<std::string> ReadBeginning(const std::string& path, size_t bytes) {
  return Read(path, bytes, std::numeric_limits<uint64_t>::max());
}

Result<std::string> ReadFile(const std::string& path, size_t most_bytes) {
  auto content = Read(path, most_bytes + 1, most_bytes);
  if (content && content->size() > most_bytes)
    return TooLarge(path, most_bytes);  // it grows, or hides its size
  return content;
}

Result<std::string> ReadText(const std::string& path, size_t most_bytes) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  auto text = ReadFile(path, most_bytes);
  if (text && text->starts_with(kByteOrderMark)) text->erase(0, kByteOrderMark.size());
  return text;
}

}  // namespace taclink

#include "client/command/live/download_target.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <system_error>
#include <utility>

#include "sensing/core/file_kind.h"

namespace taclink::command {
namespace {

Error NoTarget(const std::string& name, const std::string& what) {
  return {
      ErrorCode::kInvalidArgument,
      name + " is " + what + ", and a log is binary data; name a file, or a pipe to a program that reads it"};
}

/// Without blocking when it is written to. Of a pipe without a reader the system says ENXIO.
int OpenTarget(const std::string& path, bool is_pipe) {
  constexpr int kFlags = O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOCTTY;
  constexpr mode_t kMode = 0666;  // less the umask
  if (!is_pipe) return ::open(path.c_str(), kFlags, kMode);
  const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK);
  if (file >= 0) ::fcntl(file, F_SETFL, O_WRONLY);
  if (file >= 0 || errno != ENXIO) return file;
  fmt::print(stderr, "taclink: waiting for a program that reads from the pipe {}; ^C ends this\n", path);
  return ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
}

}  // namespace

Result<DownloadTarget> DownloadTarget::Open(const std::string& path) {
  std::signal(SIGPIPE, SIG_IGN);  // a reader that ends makes an error that says so
  DownloadTarget target(path);
  struct stat status{};
  if (target.is_stdout()) {
    target.file_ = STDOUT_FILENO;
  } else {
    target.is_new_ = ::stat(path.c_str(), &status) != 0;
    if (!target.is_new_ && (S_ISDIR(status.st_mode) || S_ISSOCK(status.st_mode)))
      return NoTarget(path, FileKind(status.st_mode));
    target.file_ = OpenTarget(path, !target.is_new_ && S_ISFIFO(status.st_mode));
    if (target.file_ < 0) return target.Failed("can't be opened", errno);
  }
  if (::isatty(target.file_) == 1) return NoTarget(target.name(), "a terminal");
  if (::fstat(target.file_, &status) != 0) return target.Failed("can't be written", errno);
  target.can_resume_ = !target.is_stdout() && S_ISREG(status.st_mode);
  if (target.can_resume_) target.there_ = static_cast<uint64_t>(status.st_size);
  target.next_ = target.start();
  return target;
}

DownloadTarget::DownloadTarget(DownloadTarget&& other) noexcept
    : path_(other.path_),
      file_(std::exchange(other.file_, -1)),
      is_new_(other.is_new_),
      can_resume_(other.can_resume_),
      there_(other.there_),
      written_(other.written_),
      next_(other.next_) {}

DownloadTarget::~DownloadTarget() {
  if (file_ >= 0 && !is_stdout()) ::close(file_);
}

Error DownloadTarget::Failed(const std::string& doing, int number) const {
  const std::string what = fmt::format("{} {}: {}", name(), doing, std::generic_category().message(number));
  switch (number) {
    case ENOENT:
    case ENOTDIR:
      return {ErrorCode::kNotFound, what + "; create its folder"};
    case EACCES:
    case EPERM:
    case EROFS:
      return {ErrorCode::kPermissionDenied, what + "; name a file in a folder that you may write to"};
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return {ErrorCode::kResourceExhausted,
              what + (can_resume_ ? "; free space, and the same command fetches the rest" : "")};
    default:
      return {ErrorCode::kUnavailable, what};
  }
}

Error DownloadTarget::HoldsSomethingElse() const {
  return {ErrorCode::kFailedPrecondition,
          name() +
              " holds something else than the log, and was not changed; name another file with -o, or "
              "remove this one"};
}

Result<void> DownloadTarget::Receive(std::string_view data, uint64_t offset) {
  if (offset != next_)
    return Error{ErrorCode::kInternal,
                 fmt::format("the server sent byte {} of the log where byte {} comes next", offset, next_)};
  next_ += data.size();
  if (offset < there_) {
    const size_t known = std::min<uint64_t>(data.size(), there_ - offset);
    if (const auto same = Compare(data.substr(0, known), offset); !same) return same;
    data.remove_prefix(known);
  }
  return Write(data);
}

Result<void> DownloadTarget::Compare(std::string_view data, uint64_t offset) const {
  std::string mine(data.size(), '\0');
  for (size_t done = 0; done < mine.size();) {
    const ssize_t count =
        ::pread(file_, mine.data() + done, mine.size() - done, static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return Failed("can't be read", errno);
    if (count == 0) return HoldsSomethingElse();  // another program has shortened it
    done += static_cast<size_t>(count);
  }
  if (mine != data) return HoldsSomethingElse();
  return {};
}

Result<void> DownloadTarget::Write(std::string_view data) {
  while (!data.empty()) {
    const ssize_t count = ::write(file_, data.data(), data.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno == EAGAIN) {  // standard output may be another program's that does not block
      pollfd ready{.fd = file_, .events = POLLOUT, .revents = 0};
      ::poll(&ready, 1, -1);
      continue;
    }
    if (count < 0) return Failed(fmt::format("can't be written after {} bytes", size()), errno);
    data.remove_prefix(static_cast<size_t>(count));
    written_ += static_cast<uint64_t>(count);
  }
  return {};
}

Result<void> DownloadTarget::Close() {
  if (next_ < there_) return HoldsSomethingElse();  // more than the log
  const int file = std::exchange(file_, -1);
  if (file < 0 || is_stdout() || ::close(file) == 0) return {};
  return Failed("can't be closed", errno);
}

void DownloadTarget::RemoveIfNew() {
  if (is_new_ && can_resume_ && size() == 0) ::unlink(path_.c_str());
}

}  // namespace taclink::command

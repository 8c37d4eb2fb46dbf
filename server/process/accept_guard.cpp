// gRPC (1.51, Debian 12's) ends its listener for good when a connection can't be accepted for want of
// descriptors or of memory: nobody could connect any more until the server is started again. This program's
// accept4 is the one that gRPC's library calls, and never says so.
#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <mutex>
#include <system_error>

namespace {

int SysAccept(int listener, sockaddr* address, socklen_t* length, int flags) {
  return static_cast<int>(::syscall(SYS_accept4, listener, address, length, flags));
}

bool IsWant(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

/// A descriptor that is given up to tell a client at once that it can't be served now, instead of letting it
/// wait.
class Spare {
 public:
  Spare() : file_(Open()) {}

  // 0, or why not: EAGAIN where nobody waits. Another thread may take the descriptor meanwhile: asked again,
  // for those who wait are told of only once.
  int Refuse(int listener) {
    constexpr int kTries = 10;
    const std::lock_guard lock(mutex_);
    int error = EMFILE;
    for (int i = 0; i < kTries && IsWant(error); ++i) {
      if (file_ >= 0) ::close(file_);
      const int connection = SysAccept(listener, nullptr, nullptr, SOCK_CLOEXEC);
      error = connection < 0 ? errno : 0;
      if (connection >= 0) ::close(connection);
      file_ = Open();
    }
    return error;
  }

 private:
  static int Open() { return ::open("/dev/null", O_RDONLY | O_CLOEXEC); }

  std::mutex mutex_;
  int file_;
};

Spare spare;  // while there are descriptors

}  // namespace

// The name is the C library's.
// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int accept4(int listener, sockaddr* address, socklen_t* length, int flags) {
  while (true) {
    const int connection = SysAccept(listener, address, length, flags);
    if (connection >= 0 || !IsWant(errno)) return connection;
    const int want = errno;  // also where nobody waits: descriptors come first
    const int refused = spare.Refuse(listener);
    if (refused == ECONNABORTED || refused == EINTR) continue;  // that one has gone
    if (refused != EAGAIN) {
      SPDLOG_ERROR("a connection can't be accepted: {}; raise LimitNOFILE, or end some clients",
                   std::generic_category().message(want));
    }
    if (refused == 0) continue;
    errno = EAGAIN;  // asked again when the next one comes
    return -1;
  }
}

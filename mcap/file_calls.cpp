#include "mcap/file_calls.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

namespace taclink::mcap {

int FileCalls::Open(const std::string& path, int flags, mode_t mode) {
  return ::open(path.c_str(), flags, mode);
}
int FileCalls::Close(int file) {
  return ::close(file);
}
ssize_t FileCalls::Write(int file, const iovec* pieces, int count) {
  return ::writev(file, pieces, count);
}
int FileCalls::Sync(int file) {
  return ::fdatasync(file);
}
int FileCalls::SyncFolder(int folder) {
  return ::fsync(folder);
}
int FileCalls::Truncate(int file, off_t length) {
  return ::ftruncate(file, length);
}
off_t FileCalls::Seek(int file, off_t offset) {
  return ::lseek(file, offset, SEEK_SET);
}
int FileCalls::Rename(const std::string& from, const std::string& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL && errno != ENOSYS) return -1;
  // NFS and others have no such call. Another program may create `to` between the two calls.
  struct stat there{};
  if (::lstat(to.c_str(), &there) == 0) {
    errno = EEXIST;
    return -1;
  }
  return std::rename(from.c_str(), to.c_str());
}
int FileCalls::Status(int file, struct stat& out) {
  return ::fstat(file, &out);
}
int FileCalls::Status(const std::string& path, struct stat& out) {
  return ::lstat(path.c_str(), &out);
}
int FileCalls::Access(const std::string& path, int mode) {
  return ::access(path.c_str(), mode);
}
int FileCalls::Lock(int file) {
  return ::flock(file, LOCK_EX | LOCK_NB);
}

FileCalls& FileCalls::System() {
  static FileCalls system;
  return system;
}

}  // namespace taclink::mcap

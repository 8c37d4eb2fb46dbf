#pragma once

#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>

#include <string>

namespace taclink::mcap {

/// What a log's file asks the system for, call by call, each as its man page says: what it returns, errno.
/// So that tests can make any of them fail. Any thread.
class FileCalls {
 public:
  virtual ~FileCalls() = default;
  virtual int Open(const std::string& path, int flags, mode_t mode);
  virtual int Close(int file);
  virtual ssize_t Write(int file, const iovec* pieces, int count);
  virtual int Sync(int file);          ///< the data; fdatasync
  virtual int SyncFolder(int folder);  ///< fsync
  virtual int Truncate(int file, off_t length);
  virtual off_t Seek(int file, off_t offset);
  /// Replaces nothing: EEXIST where `to` exists.
  virtual int Rename(const std::string& from, const std::string& to);
  virtual int Status(int file, struct stat& out);
  virtual int Status(const std::string& path, struct stat& out);  ///< lstat
  virtual int Access(const std::string& path, int mode);
  virtual int Lock(int file);  ///< flock, exclusive, without waiting

  /// The system's own.
  static FileCalls& System();
};

}  // namespace taclink::mcap

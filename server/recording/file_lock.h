#pragma once

#include <string>

#include "mcap/file_calls.h"
#include "sensing/core/result.h"

namespace taclink::server {

/// An exclusive lock (flock) on a file or folder, until the object is destroyed.
class FileLock {
 public:
  /// Does not wait. `calls` must outlive it. Errors: kFailedPrecondition (another holds it), kNotFound (there
  /// is no such file any more), kUnavailable (cannot be opened, or the file system has no locks).
  static Result<FileLock> TryTake(const std::string& path, mcap::FileCalls& calls);
  ~FileLock();
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&&) = delete;

 private:
  FileLock(int file, mcap::FileCalls& calls) : file_(file), calls_(&calls) {}

  int file_;  // -1: moved from
  mcap::FileCalls* calls_;
};

}  // namespace taclink::server

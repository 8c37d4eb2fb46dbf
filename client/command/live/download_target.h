#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink::command {

/// Where a download goes: a regular file, to which an earlier download may have written a part; or standard
/// output, a pipe or a device, which take everything from the first byte on. One thread.
class DownloadTarget {
 public:
  /// "-": standard output. Signals of pipes whose reader ends are ignored from now on. A pipe that nobody
  /// reads is waited for, which a line on stderr says. Errors: kInvalidArgument (a folder, a socket, a
  /// terminal), kPermissionDenied, kNotFound, kUnavailable.
  static Result<DownloadTarget> Open(const std::string& path);
  ~DownloadTarget();
  DownloadTarget(DownloadTarget&& other) noexcept;
  DownloadTarget& operator=(DownloadTarget&&) = delete;

  uint64_t there() const {
    return there_;
  }  ///< bytes that it had when it was opened; 0 if it can't be resumed
  uint64_t size() const { return there_ + written_; }
  bool can_resume() const { return can_resume_; }
  bool is_stdout() const { return path_ == "-"; }
  /// For messages.
  std::string name() const { return is_stdout() ? "standard output" : path_; }

  /// Behind what was written before. Errors: kResourceExhausted (full), kUnavailable, with the system's
  /// reason.
  Result<void> Write(std::string_view data);
  /// Errors: likewise.
  Result<void> Close();
  /// Takes a file that Open has made and to which nothing was written away again.
  void RemoveIfNew();

 private:
  explicit DownloadTarget(std::string path) : path_(std::move(path)) {}
  Error Failed(const std::string& doing, int number) const;

  std::string path_;
  int file_ = -1;
  bool is_new_ = false;
  bool can_resume_ = false;
  uint64_t there_ = 0, written_ = 0;
};

}  // namespace taclink::command

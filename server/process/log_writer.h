#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink::server {

/// Lines that no reader will see, in a row.
struct LeftOutLines {
  size_t count = 0;
  std::chrono::duration<double> during{};
  int error = 0;  ///< errno of the last write that failed; 0: none failed, the queue was full
};

/// Writes lines from a thread of its own. A terminal that was stopped, a pipe that nobody reads, a disk that
/// hangs or is full stop this thread alone: callers never wait. Lines are written in the order of `Push`;
/// those that find the queue full, and all that follow until it is empty, are counted, and so are those
/// whose write fails. The count is written as soon as writing works again. The destructor does not wait
/// either: the thread writes what is queued, as far as it can before the process ends, and owns all it uses.
class LogWriter {
 public:
  using Clock = std::chrono::steady_clock;
  /// As write(2): the bytes written, or -1 and errno. Only the thread calls it.
  using Write = std::function<ssize_t(std::string_view)>;
  /// Makes the line that tells a count. Only the thread calls it.
  using CountLine = std::function<std::string(const LeftOutLines&)>;
  using Now = std::function<Clock::time_point()>;
  struct Limits {
    size_t lines = 4096;
    size_t bytes = size_t{4} << 20;
  };

  /// Throws std::runtime_error where no thread can be had.
  LogWriter(Write write, CountLine count_line);
  LogWriter(Write write, CountLine count_line, const Limits& limits, Now now);
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  /// `line` ends with a line feed.
  void Push(std::string line);
  /// Waits until what was pushed before is written, or counted and told, but no longer than `limit`; false:
  /// something is left.
  bool Flush(std::chrono::milliseconds limit);

 private:
  struct State;
  const std::shared_ptr<State> state_;  // the thread's as well
};

/// Writes to a descriptor that the caller keeps open; waits where it is non-blocking.
LogWriter::Write ToDescriptor(int descriptor);
/// Appends to a regular file, which is made with its folder where missing, and closes it at the end. Errors:
/// kInvalidArgument (another kind of file), kUnavailable.
Result<LogWriter::Write> ToFile(const std::string& path);

}  // namespace taclink::server

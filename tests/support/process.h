#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

namespace taclink::testing {

struct Finished {
  int exit_code = -1;  ///< -1: ended by a signal
  std::string out, err;
};

/// A program that this test started; killed if it still runs at the end.
class Process {
 public:
  explicit Process(const std::vector<std::string>& command);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal) const;
  /// Next line of standard output (or error, with `from_err`); none: the stream ended or nothing came in
  /// time.
  std::optional<std::string> ReadLine(std::chrono::seconds timeout, bool from_err = false);
  /// The first line that contains `text`.
  std::optional<std::string> ReadUntil(const std::string& text, std::chrono::seconds timeout,
                                       bool from_err = false);
  /// Reads both streams to their ends. Exit code -2: it did not end in time and was killed.
  Finished Wait(std::chrono::seconds timeout);
  /// Resident memory, kB.
  long ResidentKb() const;

 private:
  bool ReadMore(std::chrono::milliseconds timeout);

  pid_t pid_ = -1;
  int pipes_[2] = {-1, -1};  // out, err
  std::string buffers_[2];
};

Finished RunToEnd(const std::vector<std::string>& command,
                  std::chrono::seconds timeout = std::chrono::seconds(300));

}  // namespace taclink::testing

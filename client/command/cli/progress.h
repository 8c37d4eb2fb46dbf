#pragma once

#include <chrono>
#include <string>

namespace taclink::command {

/// Shows on standard error, if that is a terminal, how far a long command is: "37 % of the log, 14 s left".
/// Appears after two seconds and is removed with the object. One thread.
class Progress {
 public:
  /// `of`: what is done, "the log".
  explicit Progress(std::string of);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// From 0 to 1; other values are ignored.
  void Show(double share);

 private:
  const std::string of_;
  const bool wanted_;
  const std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point next_;
  bool shown_ = false;
};

/// "14 s", "3 min 20 s", "2 h 5 min".
std::string TimeLeftText(double seconds);

/// Time that the rest takes at the same speed, s; `share`: what is done, from 0 to 1, in `spent_s`.
double SecondsLeft(double share, double spent_s);

}  // namespace taclink::command

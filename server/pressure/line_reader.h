#pragma once

#include <chrono>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink::server {

/// The number that a line consists of. None: it is no number.
std::optional<double> NumberOfLine(std::string_view line);

/// Lines out of a file descriptor, without ever waiting longer than told. Owns it.
class LineReader {
 public:
  LineReader() = default;
  explicit LineReader(int descriptor) : descriptor_(descriptor) {}
  ~LineReader();
  LineReader(LineReader&& other) noexcept;
  LineReader& operator=(LineReader&& other) noexcept;

  /// The newest whole line that has come; the first after opening may be a piece of one and is left out.
  /// Errors: kTimeout, kUnavailable (the other end has gone).
  Result<std::string> Next(std::chrono::milliseconds timeout);
  /// Likewise, but returns every line in order, the oldest first. If more than 64 wait, the oldest are
  /// dropped.
  Result<std::string> NextInTurn(std::chrono::milliseconds timeout);
  /// Writes a whole line. Never waits. Errors: kUnavailable (the other end takes no more or is gone; part of
  /// the line may have been written).
  Result<void> Write(const std::string& line);

 private:
  Result<void> Fill(std::chrono::milliseconds timeout);

  int descriptor_ = -1;
  bool in_step_ = false;           // a line's end was seen
  std::string text_;               // the incomplete line
  std::deque<std::string> lines_;  // complete lines, oldest first
};

}  // namespace taclink::server

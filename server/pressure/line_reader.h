#pragma once

#include <chrono>
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

 private:
  int descriptor_ = -1;
  bool in_step_ = false;  // a line's end was seen
  std::string text_;      // of the line that is not whole yet
};

}  // namespace taclink::server

#include "server/pressure/line_reader.h"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>

namespace taclink::server {
namespace {

constexpr size_t kLongestLine = 256;
constexpr std::string_view kBlanks = " \t\r\n";

}  // namespace

std::optional<double> NumberOfLine(std::string_view line) {
  const auto first = line.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return std::nullopt;
  line = line.substr(first, line.find_last_not_of(kBlanks) - first + 1);
  if (line.size() > 1 && line[0] == '+') line.remove_prefix(1);  // which from_chars does not know
  double value = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), value);
  if (error != std::errc() || end != line.data() + line.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

LineReader::~LineReader() {
  if (descriptor_ >= 0) close(descriptor_);
}

LineReader::LineReader(LineReader&& other) noexcept {
  *this = std::move(other);
}

LineReader& LineReader::operator=(LineReader&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(in_step_, other.in_step_);
  std::swap(text_, other.text_);
  return *this;
}

Result<std::string> LineReader::Next(std::chrono::milliseconds timeout) {
  pollfd waiting{.fd = descriptor_, .events = POLLIN, .revents = 0};
  if (poll(&waiting, 1, static_cast<int>(timeout.count())) <= 0)
    return Error{ErrorCode::kTimeout, "no line in time"};
  std::optional<std::string> newest;
  std::array<char, 4096> buffer{};
  const ssize_t got = read(descriptor_, buffer.data(), buffer.size());
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return Error{ErrorCode::kTimeout, "no line in time"};
  if (got <= 0)
    return Error{ErrorCode::kUnavailable, got == 0 ? "its other end has gone" : std::strerror(errno)};
  for (const char c : std::string_view(buffer.data(), static_cast<size_t>(got))) {
    if (c == '\n') {
      if (text_.size() == kLongestLine) text_ += "...";  // not whole, so no number
      if (std::exchange(in_step_, true)) newest = text_;
      text_.clear();
    } else if (text_.size() < kLongestLine) {
      text_ += c;
    }
  }
  if (newest) return *std::move(newest);
  return Error{ErrorCode::kTimeout, "no whole line yet"};
}

}  // namespace taclink::server

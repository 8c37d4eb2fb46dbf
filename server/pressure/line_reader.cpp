#include "server/pressure/line_reader.h"

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <utility>

namespace taclink::server {
namespace {

constexpr size_t kLongestLine = 256, kMostLines = 64;
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

// Discards the output that the device did not take: the kernel would wait for it for half a minute, and a
// device that comes back would execute outdated commands.
LineReader::~LineReader() {
  if (descriptor_ < 0) return;
  tcflush(descriptor_, TCOFLUSH);
  close(descriptor_);
}

LineReader::LineReader(LineReader&& other) noexcept {
  *this = std::move(other);
}

LineReader& LineReader::operator=(LineReader&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(in_step_, other.in_step_);
  std::swap(text_, other.text_);
  std::swap(lines_, other.lines_);
  return *this;
}

// Keeps the lines that are waiting; without any, reads once.
Result<void> LineReader::Fill(std::chrono::milliseconds timeout) {
  if (!lines_.empty()) return {};
  pollfd waiting{.fd = descriptor_, .events = POLLIN, .revents = 0};
  if (poll(&waiting, 1, static_cast<int>(timeout.count())) <= 0)
    return Error{ErrorCode::kTimeout, "no line in time"};
  std::array<char, 4096> buffer{};
  const ssize_t got = read(descriptor_, buffer.data(), buffer.size());
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return Error{ErrorCode::kTimeout, "no line in time"};
  if (got <= 0)
    return Error{ErrorCode::kUnavailable, got == 0 ? "its other end has gone" : std::strerror(errno)};
  for (const char c : std::string_view(buffer.data(), static_cast<size_t>(got))) {
    if (c == '\n') {
      if (text_.size() == kLongestLine) text_ += "...";  // not whole, so no number
      if (std::exchange(in_step_, true)) lines_.push_back(std::move(text_));
      if (lines_.size() > kMostLines) lines_.pop_front();
      text_.clear();
    } else if (text_.size() < kLongestLine) {
      text_ += c;
    }
  }
  if (!lines_.empty()) return {};
  return Error{ErrorCode::kTimeout, "no whole line yet"};
}

Result<std::string> LineReader::Next(std::chrono::milliseconds timeout) {
  if (const auto filled = Fill(timeout); !filled) return filled.error();
  std::string newest = std::move(lines_.back());
  lines_.clear();
  return newest;
}

Result<std::string> LineReader::NextInTurn(std::chrono::milliseconds timeout) {
  if (const auto filled = Fill(timeout); !filled) return filled.error();
  std::string oldest = std::move(lines_.front());
  lines_.pop_front();
  return oldest;
}

Result<void> LineReader::Write(const std::string& line) {
  const ssize_t put = write(descriptor_, line.data(), line.size());
  if (put == static_cast<ssize_t>(line.size())) return {};
  // The rest of a partly written line would be taken for the next one: the caller reopens the line.
  return Error{ErrorCode::kUnavailable,
               put >= 0 || errno == EAGAIN ? "its other end takes no more commands" : std::strerror(errno)};
}

}  // namespace taclink::server

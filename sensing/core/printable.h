#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace taclink {

/// What a text begins with: a character of UTF-8 (RFC 3629), or a byte that begins none.
struct TextPiece {
  std::string_view bytes;
  std::optional<char32_t> code;  ///< none: no character
};
/// `text` must not be empty.
TextPiece FirstPiece(std::string_view text);
bool IsUtf8(std::string_view text);

/// Whether a terminal or a program that reads lines may take it for anything but a character to show:
/// controls (also DEL and C1), line and paragraph separators, and what turns the direction of writing.
bool IsControl(char32_t code);

/// The whole pieces among the first `most_bytes`; what was cut off is told: "… 1,234 bytes more".
struct CutText {
  std::string_view kept;
  std::string told;  ///< empty: nothing was cut off
};
CutText Cut(std::string_view text, size_t most_bytes);

/// On one line, for people: controls and bytes that are no text are escaped as \n, \x1b or \u2028.
std::string Printable(std::string_view text, size_t most_bytes = std::numeric_limits<size_t>::max());

/// 1234567 as 1,234,567.
std::string WithCommas(size_t number);

}  // namespace taclink

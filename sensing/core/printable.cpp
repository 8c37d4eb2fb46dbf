#include "sensing/core/printable.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>

namespace taclink {
namespace {

uint8_t ByteAt(std::string_view text, size_t at) {
  return static_cast<uint8_t>(text[at]);
}

bool IsContinuation(uint8_t byte) {
  return byte >> 6 == 0x2;
}

void AppendHex(std::string& out, const char* format, unsigned value) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), format, value);
  out += text.data();
}

void AppendEscaped(std::string& out, const TextPiece& piece) {
  if (piece.code == U'\n') {
    out += "\\n";
  } else if (piece.code == U'\r') {
    out += "\\r";
  } else if (piece.code == U'\t') {
    out += "\\t";
  } else if (piece.code && *piece.code > 0x7F) {
    AppendHex(out, "\\u%04x", static_cast<unsigned>(*piece.code));
  } else {
    AppendHex(out, "\\x%02x", ByteAt(piece.bytes, 0));
  }
}

}  // namespace

TextPiece FirstPiece(std::string_view text) {
  const TextPiece no_character{text.substr(0, 1), std::nullopt};
  const uint8_t lead = ByteAt(text, 0);
  if (lead < 0x80) return {text.substr(0, 1), lead};
  const size_t more = lead >> 5 == 0x6 ? 1 : lead >> 4 == 0xE ? 2 : lead >> 3 == 0x1E ? 3 : 0;
  if (more == 0 || more >= text.size()) return no_character;
  char32_t code = lead & (0x3FU >> more);
  for (size_t k = 1; k <= more; ++k) {
    const uint8_t next = ByteAt(text, k);
    if (!IsContinuation(next)) return no_character;
    code = code << 6 | (next & 0x3FU);
  }
  constexpr std::array<char32_t, 4> kLeast = {0, 0x80, 0x800, 0x10000};
  if (code < kLeast[more] || code > 0x10FFFF || (code >= 0xD800 && code <= 0xDFFF)) return no_character;
  return {text.substr(0, more + 1), code};
}

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const TextPiece piece = FirstPiece(text);
    if (!piece.code) return false;
    text.remove_prefix(piece.bytes.size());
  }
  return true;
}

bool IsControl(char32_t code) {
  const auto within = [code](char32_t first, char32_t last) { return code >= first && code <= last; };
  return within(0, 0x1F) || within(0x7F, 0x9F) || within(0x200E, 0x200F) || within(0x2028, 0x202E) ||
         within(0x2066, 0x2069);
}

CutText Cut(std::string_view text, size_t most_bytes) {
  if (text.size() <= most_bytes) return {text, {}};
  constexpr size_t kLongestCharacter = 4;
  size_t end = most_bytes;
  while (end > 0 && most_bytes - end < kLongestCharacter && IsContinuation(ByteAt(text, end))) --end;
  return {text.substr(0, end), "… " + WithCommas(text.size() - end) + " bytes more"};
}

std::string Printable(std::string_view text, size_t most_bytes) {
  const CutText cut = Cut(text, most_bytes);
  std::string out;
  out.reserve(cut.kept.size() + cut.told.size());
  for (std::string_view rest = cut.kept; !rest.empty();) {
    const TextPiece piece = FirstPiece(rest);
    rest.remove_prefix(piece.bytes.size());
    if (piece.code && !IsControl(*piece.code)) {
      out += piece.bytes;
    } else {
      AppendEscaped(out, piece);
    }
  }
  return out + cut.told;
}

std::string WithCommas(size_t number) {
  std::string digits = std::to_string(number);
  for (size_t at = digits.size(); at > 3;) digits.insert(at -= 3, 1, ',');
  return digits;
}

}  // namespace taclink

#include "sensing/core/name.h"

#include <algorithm>
#include <string>

#include "sensing/core/printable.h"

namespace taclink {
namespace {

bool IsLetterOrDigit(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

bool IsPrintable(char c) {
  return c >= ' ' && c <= '~';
}

// Foreign text in a message: only where it can't do harm, and not all of a long one.
std::string NotThis(std::string_view text) {
  if (text.empty()) return ", not nothing";
  if (!std::all_of(text.begin(), text.end(), IsPrintable)) return "";
  const std::string_view beginning = text.substr(0, kLongestName);
  return ", not '" + std::string(beginning) + (beginning.size() < text.size() ? "..." : "") + "'";
}

bool IsName(std::string_view name, bool dots) {
  if (name.empty() || name.size() > kLongestName || name[0] == '-' || name[0] == '.') return false;
  return std::all_of(name.begin(), name.end(), [dots](char c) {
    return IsLetterOrDigit(c) || c == '_' || c == '-' || (dots && c == '.');
  });
}

bool IsPlainText(std::string_view text) {
  while (!text.empty()) {
    const TextPiece piece = FirstPiece(text);
    const bool may = piece.code == U'\n' || piece.code == U'\t';
    if (!piece.code || (IsControl(*piece.code) && !may)) return false;
    text.remove_prefix(piece.bytes.size());
  }
  return true;
}

}  // namespace

Result<void> CheckName(std::string_view name) {
  if (IsName(name, true)) return {};
  return Error{
      ErrorCode::kInvalidArgument,
      "must be 1 to 64 letters, digits, '_', '-' and '.', the first neither '-' nor '.'" + NotThis(name)};
}

Result<void> CheckSubjectPart(std::string_view name) {
  if (IsName(name, false)) return {};
  return Error{ErrorCode::kInvalidArgument,
               "must be 1 to 64 letters, digits, '_' and '-', the first not '-'" + NotThis(name)};
}

Result<void> CheckNote(std::string_view note) {
  if (note.size() > kLongestNote)
    return Error{ErrorCode::kInvalidArgument,
                 "must be at most 4096 bytes, not " + std::to_string(note.size())};
  if (!IsPlainText(note))
    return Error{
        ErrorCode::kInvalidArgument,
        "must be UTF-8 without control characters but newlines and tabs, also none that turn the direction"};
  return {};
}

}  // namespace taclink

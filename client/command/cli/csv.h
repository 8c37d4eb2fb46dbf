#pragma once

#include <charconv>
#include <string>
#include <system_error>
#include <vector>

namespace taclink::command {

/// A line's fields, without blanks and quotes around them. Quoted commas are not known.
std::vector<std::string> CsvFields(const std::string& line);

/// A field of a line to write: in quotes if it has commas, quotes or line ends (RFC 4180).
std::string CsvCell(const std::string& text);

/// Nothing there, or a comment (#).
bool IsEmptyCsvLine(const std::string& line);

/// A number that is all of `text`; false otherwise. "nan" and "inf" are numbers.
template <typename T>
bool ParseWhole(const std::string& text, T& value) {
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && stop == end;
}

}  // namespace taclink::command

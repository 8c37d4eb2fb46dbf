#include "client/command/cli/csv.h"

namespace taclink::command {

std::vector<std::string> CsvFields(const std::string& line) {
  constexpr const char* kBlanks = " \t\r\"";
  std::vector<std::string> fields(1);
  for (const char c : line) {
    if (c == ',') {
      fields.emplace_back();
    } else {
      fields.back() += c;
    }
  }
  for (auto& field : fields) {
    field.erase(0, field.find_first_not_of(kBlanks));
    field.erase(field.find_last_not_of(kBlanks) + 1);
  }
  return fields;
}

std::string CsvCell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string cell = "\"";
  for (const char c : text) {
    if (c == '"') cell += '"';
    cell += c;
  }
  return cell + '"';
}

bool IsEmptyCsvLine(const std::string& line) {
  return line.find_first_not_of(" \t\r") == std::string::npos || line[0] == '#';
}

}  // namespace taclink::command

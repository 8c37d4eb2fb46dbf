#include "client/command/joint_lines.h"

#include <charconv>
#include <cmath>
#include <utility>

#include "client/command/json.h"

namespace taclink::command {
namespace {

constexpr const char* kTime = "time_s";

std::string Trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::vector<std::string> Split(const std::string& line) {
  std::vector<std::string> cells;
  size_t begin = 0;
  while (true) {
    const size_t end = line.find(',', begin);
    cells.push_back(Trimmed(line.substr(begin, end - begin)));
    if (end == std::string::npos) return cells;
    begin = end + 1;
  }
}

std::optional<double> ToNumber(const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

Error JointLineReader::Wrong(const std::string& what) const {
  return {ErrorCode::kInvalidArgument, "line " + std::to_string(number_) + ": " + what};
}

Result<std::optional<JointLine>> JointLineReader::Read(const std::string& raw) {
  ++number_;
  const std::string line = Trimmed(raw);
  if (line.empty() || line[0] == '#') return std::optional<JointLine>();
  if (!json_) json_ = line[0] == '{';
  return *json_ ? ReadJson(line) : ReadCsv(line);
}

Result<std::optional<JointLine>> JointLineReader::ReadJson(const std::string& line) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object() || !json.contains("positions")) return Wrong("no JSON object with \"positions\"");
  JointLine out;
  try {
    const Json& positions = json.at("positions");
    if (positions.is_object()) {
      for (const auto& [name, position] : positions.items()) {
        out.names.push_back(name);
        out.positions.push_back(position.get<double>());
      }
    } else {
      out.names = json.at("names").get<std::vector<std::string>>();
      out.positions = positions.get<std::vector<double>>();
    }
    if (json.contains("velocities")) out.velocities = json.at("velocities").get<std::vector<double>>();
    if (json.contains(kTime)) out.time_s = json.at(kTime).get<double>();
  } catch (const Json::exception&) {
    return Wrong(R"("positions" must be {"joint": number, ...}, or a list beside "names")");
  }
  const auto differs = [&](const char* key, size_t count) {
    return Wrong(std::to_string(count) + " \"" + key + "\" for " + std::to_string(out.names.size()) +
                 " joints; give one number per joint");
  };
  if (out.positions.size() != out.names.size()) return differs("positions", out.positions.size());
  if (!out.velocities.empty() && out.velocities.size() != out.names.size())
    return differs("velocities", out.velocities.size());
  return std::optional(std::move(out));
}

Result<std::optional<JointLine>> JointLineReader::ReadCsv(const std::string& line) {
  const auto cells = Split(line);
  if (columns_.empty()) {
    if (ToNumber(cells[0]))
      return Wrong("CSV begins with a line that names the columns: time_s and the joints");
    columns_ = cells;
    return std::optional<JointLine>();
  }
  if (cells.size() != columns_.size())
    return Wrong(std::to_string(cells.size()) + " cells for " + std::to_string(columns_.size()) + " columns");
  JointLine out;
  for (size_t i = 0; i < cells.size(); ++i) {
    const auto value = ToNumber(cells[i]);
    if (!value) return Wrong("'" + cells[i] + "' in column '" + columns_[i] + "' is not a number");
    if (columns_[i] == kTime) {
      out.time_s = *value;
    } else {
      out.names.push_back(columns_[i]);
      out.positions.push_back(*value);
    }
  }
  return std::optional(std::move(out));
}

}  // namespace taclink::command

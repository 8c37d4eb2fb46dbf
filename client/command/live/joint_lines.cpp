#include "client/command/live/joint_lines.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include "client/command/cli/json.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

constexpr const char* kTime = "time_s";
constexpr double kMostTime = 1e9;   // s, some 30 years; nanoseconds of it fit 64 bits
constexpr int kMostDepth = 100;     // of objects and lists
constexpr size_t kMostQuoted = 40;  // bytes of a cell in a message
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

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
  // Before anything is trimmed or skipped, because what follows in the file is the rest of this line.
  if (raw.size() > kLongestJointLine) return Wrong("longer than " + WithCommas(kLongestJointLine) + " bytes");
  const bool marked = number_ == 1 && raw.starts_with(kByteOrderMark);
  const std::string line = Trimmed(marked ? raw.substr(kByteOrderMark.size()) : raw);
  if (line.empty() || line[0] == '#') return std::optional<JointLine>();
  if (line.find('\0') != std::string::npos || !IsUtf8(line)) return Wrong("not UTF-8 text");
  if (!json_) json_ = line[0] == '{';
  auto read = *json_ ? ReadJson(line) : ReadCsv(line);
  if (read && *read && (*read)->time_s && !(std::abs(*(*read)->time_s) <= kMostTime))
    return Wrong("time_s must be -1e9 to 1e9 s");
  return read;
}

Result<std::optional<JointLine>> JointLineReader::ReadJson(const std::string& line) {
  int deepest = 0;
  // What lies deeper is not made: who works on values recurses into them.
  const auto limit_depth = [&deepest](int depth, Json::parse_event_t event, const Json&) {
    const bool begins =
        event == Json::parse_event_t::object_start || event == Json::parse_event_t::array_start;
    deepest = std::max(deepest, depth + (begins ? 1 : 0));
    return deepest <= kMostDepth;
  };
  const Json json = Json::parse(line, limit_depth, false);
  if (deepest > kMostDepth)
    return Wrong("its JSON is nested to a depth of " + std::to_string(deepest) + "; at most " +
                 std::to_string(kMostDepth) + " is read");
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
    if (const auto read = ReadColumns(cells); !read) return read.error();
    return std::optional<JointLine>();
  }
  if (cells.size() != columns_.size())
    return Wrong(std::to_string(cells.size()) + " cells for " + std::to_string(columns_.size()) + " columns");
  JointLine out;
  for (size_t i = 0; i < cells.size(); ++i) {
    const auto value = ToNumber(cells[i]);
    if (!value)
      return Wrong("'" + Printable(cells[i], kMostQuoted) + "' in column '" + columns_[i] +
                   "' is not a number");
    if (columns_[i] == kTime) {
      out.time_s = *value;
    } else {
      out.names.push_back(columns_[i]);
      out.positions.push_back(*value);
    }
  }
  return std::optional(std::move(out));
}

Result<void> JointLineReader::ReadColumns(std::vector<std::string> names) {
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    const std::string quoted = "'" + Printable(name, kMostQuoted) + "'";
    // A number, or what JSON's arrays and texts begin with, is a line of data.
    if (ToNumber(name) || name.empty() || std::string_view("[]{}\"").find(name[0]) != std::string_view::npos)
      return Wrong(quoted +
                   " names no column; begin with a JSON object {\"positions\": ...}, or with CSV's "
                   "first line: time_s and the joints' names");
    if (Printable(name) != name) return Wrong(quoted + " has control characters");
    if (std::find(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(i), name) !=
        names.begin() + static_cast<std::ptrdiff_t>(i))
      return Wrong("two columns are named " + quoted);
  }
  columns_ = std::move(names);
  return {};
}

}  // namespace taclink::command

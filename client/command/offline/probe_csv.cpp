#include "client/command/offline/probe_csv.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <optional>

#include "client/command/cli/csv.h"
#include "sensing/core/read_file.h"

namespace taclink::command {
namespace {

enum Column : size_t { kRing, kDepth, kPressure, kForce, kColumns };
constexpr std::array<const char*, kColumns> kNames = {"ring", "depth_mm", "pressure_kpa", "force_n"};

struct Header {
  size_t fields = 0;
  std::array<size_t, kColumns> at{};
};

Error Bad(const std::string& what) {
  return {ErrorCode::kInvalidArgument, what};
}

// The messages of both lack file and line; the caller adds them.
Result<Header> ParseHeader(const std::string& line) {
  auto fields = CsvFields(line);
  std::replace(fields.begin(), fields.end(), std::string("j"), std::string(kNames[kRing]));
  Header header{.fields = fields.size()};
  for (size_t i = 0; i < kColumns; ++i) {
    const auto found = std::find(fields.begin(), fields.end(), kNames[i]);
    if (found == fields.end()) {
      return Bad(std::string("the header has no column '") + kNames[i] +
                 "'; needed are ring (or j), depth_mm, pressure_kpa and force_n");
    }
    header.at[i] = static_cast<size_t>(found - fields.begin());
  }
  return header;
}

Result<ProbeRecord> ParseRow(const std::string& line, const Header& header, const LinkModel& model) {
  const auto fields = CsvFields(line);
  if (fields.size() != header.fields) {
    return Bad("expected " + std::to_string(header.fields) + " columns as in the header, not " +
               std::to_string(fields.size()));
  }
  const auto field = [&](Column column) { return fields[header.at[column]]; };
  int ring = 0;
  if (!ParseWhole(field(kRing), ring) || ring < 1 || ring > model.markers.rings()) {
    return Bad("no ring '" + field(kRing) + "'; model '" + model.name + "' has rings 1 to " +
               std::to_string(model.markers.rings()));
  }
  std::array<double, kColumns> numbers{};
  for (const Column column : {kDepth, kPressure, kForce}) {
    if (!ParseWhole(field(column), numbers[column]) || !std::isfinite(numbers[column])) {
      return Bad(std::string(kNames[column]) + " '" + field(column) + "' is not a finite number");
    }
  }
  return ProbeRecord{.ring = ring - 1,
                     .depth_mm = numbers[kDepth],
                     .pressure_mpa = numbers[kPressure] * 1e-3,
                     .force_n = numbers[kForce]};
}

}  // namespace

Result<std::vector<ProbeRecord>> ReadProbeCsv(const std::string& path, const LinkModel& model,
                                              double diameter_mm) {
  const auto text = ReadText(path, kMostTableBytes);
  if (!text) return text.error();
  std::istringstream in(*text);
  std::vector<ProbeRecord> records;
  std::optional<Header> header;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (IsEmptyCsvLine(line)) continue;
    const std::string where = path + ":" + std::to_string(number);
    if (!header) {
      auto parsed = ParseHeader(line);
      if (!parsed) return Bad(where + ": " + parsed.error().message);
      header = *parsed;
      continue;
    }
    auto record = ParseRow(line, *header, model);
    if (!record) return Bad(where + ": " + record.error().message);
    record->name = where;
    record->diameter_mm = diameter_mm;
    records.push_back(*std::move(record));
  }
  if (records.empty()) return Bad(path + ": holds no row");
  return records;
}

}  // namespace taclink::command

#include "client/command/offline/marker_csv.h"

#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <vector>

#include "client/command/cli/csv.h"
#include "client/command/offline/marker_noise.h"
#include "sensing/core/read_file.h"

namespace taclink::command {
namespace {

constexpr const char* kHeader = "path,ring,ux,uy,uz";

struct Row {
  int marker = 0;
  bool seen = false;
  Vec3 displacement_mm = Vec3::Zero();
};

// The message lacks file and line; the caller adds them.
Result<Row> ParseRow(const std::string& line, const LinkModel& model) {
  const auto fields = CsvFields(line);
  const auto bad = [](const std::string& what) { return Error{ErrorCode::kInvalidArgument, what}; };
  if (fields.size() != 5) return bad("expected 5 columns (" + std::string(kHeader) + ")");
  int path = 0, ring = 0;
  if (!ParseWhole(fields[0], path) || !ParseWhole(fields[1], ring))
    return bad("path and ring must be whole numbers");
  if (path < 1 || path > model.markers.paths || ring < 1 || ring > model.markers.rings()) {
    return bad("no marker (" + fields[0] + ", " + fields[1] + "); model '" + model.name + "' has " +
               std::to_string(model.markers.paths) + " paths and " + std::to_string(model.markers.rings()) +
               " rings");
  }
  Row row{.marker = model.MarkerIndex(path - 1, ring - 1)};
  if (fields[2].empty() && fields[3].empty() && fields[4].empty()) return row;
  for (int axis = 0; axis < 3; ++axis) {
    const std::string& text = fields[static_cast<size_t>(2 + axis)];
    if (!ParseWhole(text, row.displacement_mm[axis]) || !std::isfinite(row.displacement_mm[axis])) {
      return bad("displacement '" + text +
                 "' is not a finite number; leave all three empty for a missing marker");
    }
  }
  const double largest_mm = model.PointAtDepth(0, model.length_mm / 2, 0).x();
  if (!(row.displacement_mm.cwiseAbs().maxCoeff() <= largest_mm)) {
    return bad(
        "a displacement larger than the skin's radius; they are in mm, from the marker's place at rest");
  }
  row.seen = true;
  return row;
}

void SetNoise(const MarkerNoise& noise, SkinShape& shape) {
  const Vec3 variances = Vec3(noise.xy_mm, noise.xy_mm, noise.z_mm).cwiseAbs2();
  for (size_t m = 0; m < shape.sources.size(); ++m) {
    if (shape.sources[m] != MarkerSource::kBoth) continue;
    shape.covariances_mm2[m] = variances.asDiagonal();
    shape.measured[m] = {shape.displacements_mm[m], variances.cwiseInverse().asDiagonal()};
  }
}

}  // namespace

Result<SkinShape> ReadMarkerCsv(const std::string& path, const LinkModel& model,
                                std::optional<double> sigma_mm) {
  const auto text = ReadText(path, kMostTableBytes);
  if (!text) return text.error();
  std::istringstream in(*text);
  const auto count = static_cast<size_t>(model.markers.count());
  SkinShape shape;
  shape.positions_mm = model.RestMarkers();
  shape.displacements_mm.assign(count, Vec3::Zero());
  shape.covariances_mm2.assign(count, Mat3::Identity());
  shape.sources.assign(count, MarkerSource::kInferred);
  shape.measured.resize(count);
  std::vector<int> first_line(count, 0);
  std::string line;
  int number = 0;
  bool header_read = false;
  const auto fail = [&](const std::string& what) {
    return Error{ErrorCode::kInvalidArgument, path + ":" + std::to_string(number) + ": " + what};
  };
  while (std::getline(in, line)) {
    ++number;
    if (IsEmptyCsvLine(line)) continue;
    if (!header_read) {
      header_read = true;
      std::string header;
      for (const auto& field : CsvFields(line)) header += (header.empty() ? "" : ",") + field;
      if (header != kHeader) return fail("the header must be '" + std::string(kHeader) + "'");
      continue;
    }
    const auto row = ParseRow(line, model);
    if (!row) return fail(row.error().message);
    const auto m = static_cast<size_t>(row->marker);
    if (first_line[m] != 0)
      return fail("this marker stands in line " + std::to_string(first_line[m]) + " already");
    first_line[m] = number;
    if (!row->seen) continue;
    shape.displacements_mm[m] = row->displacement_mm;
    shape.positions_mm[m] += row->displacement_mm;
    shape.sources[m] = MarkerSource::kBoth;
  }
  if (shape.seen() < 3) return Error{ErrorCode::kInvalidArgument, path + ": holds fewer than 3 markers"};
  SetNoise(sigma_mm ? MarkerNoise{*sigma_mm, 3 * *sigma_mm} : NoiseOf(model, shape), shape);
  return shape;
}

}  // namespace taclink::command

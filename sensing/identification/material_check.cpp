#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/identification/material_evidence.h"

namespace taclink {
namespace {

constexpr double kMostPressureMpa = 0.02;  // as for pushes
constexpr int kFewestMarkers = 10;
constexpr double kMostOutliers = 0.25;  // of a record
constexpr int kTouchedMarkers = 4;      // side by side, all further in than the rest: no chance

Error Bad(const std::string& what) {
  return {ErrorCode::kInvalidArgument, what};
}

Result<void> CheckPressure(const std::string& name, double pressure_mpa) {
  if (!(pressure_mpa >= 0 && pressure_mpa <= kMostPressureMpa)) {
    return Bad(name + ": the gauge pressure must be from 0 to 20 kPa; suction buckles a skin");
  }
  return {};
}

Result<void> CheckInflation(const LinkModel& model, const InflationRecord& record) {
  if (auto good = CheckPressure(record.name, record.pressure_mpa); !good) return good;
  if (static_cast<int>(record.markers.size()) != model.markers.count()) {
    return Bad(record.name + ": " + std::to_string(record.markers.size()) + " markers, the model has " +
               std::to_string(model.markers.count()));
  }
  int seen = 0;
  for (const MeasuredDisplacement& marker : record.markers) {
    if (!marker.displacement_mm.allFinite() || !marker.information_per_mm2.allFinite()) {
      return Bad(record.name + ": a marker's displacement or its information is no number");
    }
    seen += marker.information_per_mm2.trace() > 0 ? 1 : 0;
  }
  if (seen < kFewestMarkers) {
    return Bad(record.name + ": only " + std::to_string(seen) + " markers were seen; at least " +
               std::to_string(kFewestMarkers) + " are needed");
  }
  return {};
}

Result<void> CheckProbe(const LinkModel& model, const ProbeRecord& record) {
  if (auto good = CheckPressure(record.name, record.pressure_mpa); !good) return good;
  if (record.ring < 0 || record.ring >= model.markers.rings()) {
    return Bad(record.name + ": no such ring; model '" + model.name + "' has " +
               std::to_string(model.markers.rings()));
  }
  if (!std::isfinite(record.depth_mm) || !(record.force_n > 0 && record.force_n < 1e6) ||
      !(record.diameter_mm > 0)) {
    return Bad(record.name + ": the depth must be finite, the force and the disc's diameter above 0");
  }
  return {};
}

// Size of the largest patch of neighbouring markers that stay further in than the skin grows, and the one of
// them that is furthest in.
std::pair<int, int> TouchedPatch(const LinkModel& model, const InflationRecord& record,
                                 const SkinResponse::Growth& growth, const std::vector<int>& outliers) {
  std::vector<double> inward_mm(static_cast<size_t>(model.markers.count()), 0);
  for (const int marker : outliers) {
    const auto i = static_cast<size_t>(marker);
    const double angle = model.PathAngle(model.PathOf(marker));
    const Vec2& grown = growth.mm[static_cast<size_t>(model.RingOf(marker))];
    const Vec3 out(std::cos(angle), std::sin(angle), 0);
    const Vec3 residual = record.markers[i].displacement_mm - grown.x() * out - grown.y() * Vec3::UnitZ();
    if (residual.dot(out) < -0.5 * residual.norm()) inward_mm[i] = -residual.dot(out);
  }
  std::pair<int, int> largest{0, -1};
  for (const int first : outliers) {
    std::vector<int> open = {first};
    int size = 0, furthest = first;
    double furthest_mm = 0;
    while (!open.empty()) {
      const int marker = open.back();
      open.pop_back();
      const double mm = std::exchange(inward_mm[static_cast<size_t>(marker)], 0);
      if (mm == 0) continue;
      ++size;
      if (mm > furthest_mm) furthest = marker;
      furthest_mm = std::max(furthest_mm, mm);
      const int path = model.PathOf(marker), ring = model.RingOf(marker), paths = model.markers.paths;
      open.push_back(model.MarkerIndex((path + 1) % paths, ring));
      open.push_back(model.MarkerIndex((path + paths - 1) % paths, ring));
      if (ring > 0) open.push_back(model.MarkerIndex(path, ring - 1));
      if (ring + 1 < model.markers.rings()) open.push_back(model.MarkerIndex(path, ring + 1));
    }
    if (size > largest.first) largest = {size, furthest};
  }
  return largest;
}

}  // namespace

Result<void> CheckRecords(const LinkModel& model, std::span<const InflationRecord> inflations,
                          std::span<const ProbeRecord> probes, const MaterialFitOptions& options) {
  if (inflations.empty() && probes.empty()) return Bad("no record of inflation or of probe forces");
  if (!(options.force_sigma_n >= 0 && options.force_sigma_share >= 0 &&
        options.force_sigma_n + options.force_sigma_share > 0) ||
      options.refinement < 1 || options.refinement > 8) {
    return Bad("the forces' standard deviation must be above 0, the refinement from 1 to 8");
  }
  double highest = 0;
  for (const InflationRecord& record : inflations) {
    if (auto good = CheckInflation(model, record); !good) return good;
    highest = std::max(highest, record.pressure_mpa);
  }
  if (!inflations.empty() && highest == 0) {
    return Bad("all inflation pressures are 0: they tell nothing of Young's modulus");
  }
  for (const ProbeRecord& record : probes) {
    if (auto good = CheckProbe(model, record); !good) return good;
  }
  return {};
}

Result<void> CheckUntouched(const LinkModel& model, SkinResponse& response,
                            std::span<const InflationRecord> records, const Observations& seen,
                            const std::vector<bool>& outliers, double modulus) {
  for (size_t r = 0; r < records.size(); ++r) {
    std::vector<int> out;
    int all = 0;
    for (size_t i = 0; i < seen.size(); ++i) {
      if (seen[i].record != static_cast<int>(r)) continue;
      ++all;
      if (outliers[i]) out.push_back(seen[i].marker);
    }
    const auto growth = response.GrowthAt(records[r].pressure_mpa / modulus);
    if (!growth) return growth.error();
    const auto [size, marker] = TouchedPatch(model, records[r], *growth, out);
    if (size >= kTouchedMarkers) {
      return Error{
          ErrorCode::kFailedPrecondition,
          records[r].name + ": touched near path " + std::to_string(model.PathOf(marker) + 1) + ", ring " +
              std::to_string(model.RingOf(marker) + 1) + ": " + std::to_string(size) +
              " markers there don't move out as the others; take it again with nothing near the skin"};
    }
    if (static_cast<double>(out.size()) > kMostOutliers * all) {
      return Error{ErrorCode::kFailedPrecondition,
                   records[r].name + ": " + std::to_string(out.size()) + " of " + std::to_string(all) +
                       " markers don't move as an inflated skin's; check the model, the labels, and that the "
                       "rest shape belongs to this skin"};
    }
  }
  return {};
}

}  // namespace taclink

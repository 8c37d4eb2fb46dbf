#include "sensing/estimation/isolated_markers.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr double kLeastSpreadMm = 0.5, kLeastMm = 0.8;
constexpr size_t kLeastNeighbors = 3;

// Along what was measured: one camera tells two directions.
double Distance(const Vec3& a, const Vec3& b, const Mat3& information) {
  const Vec3 off = a - b;
  return std::sqrt(off.dot(information * off) * 3 / information.trace());
}

}  // namespace

int HideIsolated(const LinkModel& model, const Eigen::VectorXd& without_loads_mm, double most, double unit,
                 MarkerObservations& observed) {
  const int paths = model.markers.paths, rings = model.markers.rings();
  const auto is_seen = [&](int m) { return observed.information[static_cast<size_t>(m)].trace() > 0; };
  std::vector<size_t> found;
  std::vector<Vec3> around;
  for (int ring = 0; ring < rings; ++ring) {
    for (int path = 0; path < paths; ++path) {
      const int marker = model.MarkerIndex(path, ring);
      if (!is_seen(marker)) continue;
      around.clear();
      for (int r = std::max(0, ring - 1); r <= std::min(rings - 1, ring + 1); ++r) {
        for (int p = path - 1; p <= path + 1; ++p) {
          const int m = model.MarkerIndex((p + paths) % paths, r);
          if (m != marker && is_seen(m)) around.push_back(observed.displacement_mm[static_cast<size_t>(m)]);
        }
      }
      if (around.size() < kLeastNeighbors) continue;
      const auto at = static_cast<size_t>(marker);
      const Mat3& information = observed.information[at];
      double nearest_mm = 1e9, spread_mm = 0;
      for (const Vec3& neighbor : around)
        nearest_mm = std::min(nearest_mm, Distance(observed.displacement_mm[at], neighbor, information));
      around.push_back(without_loads_mm.segment<3>(3 * marker));
      for (size_t i = 0; i < around.size(); ++i) {
        for (size_t k = 0; k < i; ++k)
          spread_mm = std::max(spread_mm, Distance(around[i], around[k], information));
      }
      if (nearest_mm > kLeastMm * unit && nearest_mm > most * (spread_mm + kLeastSpreadMm * unit))
        found.push_back(at);
    }
  }
  for (const size_t m : found) observed.information[m].setZero();
  return static_cast<int>(found.size());
}

}  // namespace taclink

#include "sensing/estimation/unseen_markers.h"

#include <Eigen/Geometry>
#include <array>
#include <numbers>

namespace taclink {
namespace {

constexpr double kSigmaMm = 0.35;  // of an interpolated displacement, per marker to the nearest seen one
constexpr int kSweeps = 20;        // of Gauss-Seidel, after values that are already near

// The markers of the rings and paths beside one, -1: none; and the turn from their axes to its own.
struct Beside {
  std::array<int, 4> markers;
  std::array<double, 4> turns_rad;
};

Beside MarkersBeside(const LinkModel& model, int marker) {
  const int paths = model.markers.paths, path = model.PathOf(marker), ring = model.RingOf(marker);
  const double turn = 2 * std::numbers::pi / paths;
  return {{model.MarkerIndex((path + 1) % paths, ring), model.MarkerIndex((path + paths - 1) % paths, ring),
           ring > 0 ? model.MarkerIndex(path, ring - 1) : -1,
           ring + 1 < model.markers.rings() ? model.MarkerIndex(path, ring + 1) : -1},
          {-turn, turn, 0, 0}};
}

}  // namespace

void InterpolateUnseen(const LinkModel& model, const Eigen::VectorXd& without_loads_mm, double unit,
                       MarkerObservations& observed) {
  const auto at = [](int marker) { return static_cast<size_t>(marker); };
  std::vector<int> distances(at(model.markers.count()), -1), reached;
  for (int m = 0; m < model.markers.count(); ++m) {
    if (observed.information[at(m)].isZero()) continue;
    distances[at(m)] = 0;
    reached.push_back(m);
  }
  const size_t seen = reached.size();
  for (size_t i = 0; i < reached.size(); ++i) {
    for (const int m : MarkersBeside(model, reached[i]).markers) {
      if (m < 0 || distances[at(m)] >= 0) continue;
      distances[at(m)] = distances[at(reached[i])] + 1;
      reached.push_back(m);
    }
  }
  const auto relax = [&](int m, int most_distance) {
    const Beside beside = MarkersBeside(model, m);
    Vec3 sum = Vec3::Zero();
    int count = 0;
    for (size_t i = 0; i < beside.markers.size(); ++i) {
      const int other = beside.markers[i];
      if (other < 0 || distances[at(other)] > most_distance) continue;
      const Vec3 dent = observed.displacement_mm[at(other)] - without_loads_mm.segment<3>(3 * other);
      sum += Eigen::AngleAxisd(beside.turns_rad[i], Vec3::UnitZ()) * dent;
      ++count;
    }
    observed.displacement_mm[at(m)] = without_loads_mm.segment<3>(3 * m) + sum / count;
  };
  for (size_t i = seen; i < reached.size(); ++i) relax(reached[i], distances[at(reached[i])] - 1);
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (size_t i = seen; i < reached.size(); ++i) relax(reached[i], model.markers.count());
  }
  for (size_t i = seen; i < reached.size(); ++i) {
    const double sigma_mm = kSigmaMm * unit * distances[at(reached[i])];
    observed.information[at(reached[i])] = Mat3::Identity() / (sigma_mm * sigma_mm);
  }
}

}  // namespace taclink

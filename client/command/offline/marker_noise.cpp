#include "client/command/offline/marker_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace taclink::command {
namespace {

constexpr std::array<double, 7> kSixthDifference = {1, -6, 15, -20, 15, -6, 1};
constexpr double kDifferenceOfNoise = 30.397368;  // root of the sum of its squares, 924
constexpr double kMedianOfNormal = 0.67449;       // of |x|, standard deviation 1
constexpr double kWidestPitch = 0.9;              // of sqrt(R t); farther apart, a dent differs like noise
constexpr size_t kFewest = 20;

double DeviationOf(std::vector<double>& sizes) {
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle / (kDifferenceOfNoise * kMedianOfNormal);
}

}  // namespace

MarkerNoise NoiseOf(const LinkModel& model, const SkinShape& shape) {
  MarkerNoise noise;
  const int paths = model.markers.paths;
  const double radius_mm = model.PointAtDepth(0, model.length_mm / 2, model.thickness_mm / 2).x();
  const double pitch_mm = radius_mm * model.markers.path_pitch_rad();
  if (pitch_mm > kWidestPitch * std::sqrt(radius_mm * model.thickness_mm)) return noise;
  std::vector<double> across, along;
  for (int ring = 0; ring < model.markers.rings(); ++ring) {
    for (int path = 0; path < paths; ++path) {
      // Radial, tangential and axial: a skin that grows all around has no differences then.
      Vec3 difference = Vec3::Zero();
      bool is_whole = true;
      for (int k = 0; k < 7 && is_whole; ++k) {
        const int at = (path + k) % paths;
        const auto m = static_cast<size_t>(model.MarkerIndex(at, ring));
        is_whole = shape.sources[m] != MarkerSource::kInferred;
        const double angle = model.PathAngle(at);
        const Vec3& u = shape.displacements_mm[m];
        difference += kSixthDifference[static_cast<size_t>(k)] *
                      Vec3(u.x() * std::cos(angle) + u.y() * std::sin(angle),
                           u.y() * std::cos(angle) - u.x() * std::sin(angle), u.z());
      }
      if (!is_whole) continue;
      across.push_back(std::abs(difference.x()));
      across.push_back(std::abs(difference.y()));
      along.push_back(std::abs(difference.z()));
    }
  }
  if (along.size() < kFewest) return noise;
  noise.xy_mm = std::max(noise.xy_mm, DeviationOf(across));
  noise.z_mm = std::max(noise.z_mm, DeviationOf(along));
  return noise;
}

}  // namespace taclink::command

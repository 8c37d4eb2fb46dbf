#include "sensing/estimation/neighborhoods.h"

#include <cmath>

namespace taclink {
namespace {

// Found on three-dimensional solids (docs/calculix.md); in SkinMechanics' units of length.
constexpr double kMotionLengthMm = 20, kCommonShare = 0.8;
constexpr double kSpreadMm = 12;
constexpr double kInflationLengthMm = 15;
constexpr double kLocalMm = 15;
constexpr double kHillMm = 10;

double Bell(double distance2, double width) {
  return std::exp(-distance2 / (2 * width * width));
}

// Symmetric, of distances.
template <typename Distance2>
Eigen::MatrixXd Bells(int count, double width, Distance2 distance2) {
  Eigen::MatrixXd bells(count, count);
  for (int j = 0; j < count; ++j) {
    for (int i = j; i < count; ++i) bells(i, j) = bells(j, i) = Bell(distance2(i, j), width);
  }
  return bells;
}

}  // namespace

Neighborhoods::Neighborhoods(const SkinMechanics& mechanics) {
  const int markers = mechanics.marker_count(), sites = mechanics.site_count();
  const double unit = mechanics.length_unit();
  const auto of_markers = [&](int i, int j) {
    return (mechanics.RestMarker(i) - mechanics.RestMarker(j)).squaredNorm();
  };
  const auto of_sites = [&](int i, int j) {
    return (mechanics.RestSite(i) - mechanics.RestSite(j)).squaredNorm();
  };
  const auto along = [&](int i, int j) {
    const double off = mechanics.RestMarker(i).z() - mechanics.RestMarker(j).z();
    return off * off;
  };
  motion_near = Bells(markers, kSpreadMm * unit, of_markers);
  motion_alike = kCommonShare * Bells(markers, kMotionLengthMm * unit, of_markers);
  motion_alike.diagonal().setOnes();
  growth_alike = Bells(markers, kInflationLengthMm * unit, along);
  local_sites = Bells(sites, kLocalMm * unit, of_sites);
  load_sites = Bells(sites, kHillMm * unit, of_sites);
  local_markers.resize(sites, markers);
  for (int m = 0; m < markers; ++m) {
    for (int site = 0; site < sites; ++site)
      local_markers(site, m) =
          Bell((mechanics.RestSite(site) - mechanics.RestMarker(m)).squaredNorm(), kLocalMm * unit);
  }
}

}  // namespace taclink

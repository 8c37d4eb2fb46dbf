#include "sensing/estimation/neighborhoods.h"

#include <cmath>
#include <mutex>
#include <vector>

namespace taclink {
namespace {

// Found on three-dimensional solids (docs/reports/calculix.md); in SkinMechanics' units of length.
constexpr double kMotionLengthMm = 20, kMotionShare = 0.8;
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

SiteBells::SiteBells(const SkinMechanics& mechanics, double width_mm)
    : columns_(mechanics.columns()), about_first_(mechanics.site_count(), mechanics.site_rows()) {
  for (int row = 0; row < mechanics.site_rows(); ++row) {
    const Vec3& first_mm = mechanics.RestSite(row * columns_);
    for (int site = 0; site < mechanics.site_count(); ++site)
      about_first_(site, row) = Bell((mechanics.RestSite(site) - first_mm).squaredNorm(), width_mm);
  }
}

double SiteBells::operator()(int site, int other) const {
  const int apart = (site % columns_ - other % columns_ + columns_) % columns_;
  return about_first_(site / columns_ * columns_ + apart, other / columns_);
}

void SiteBells::AddTo(Eigen::Ref<Eigen::VectorXd> sum, int site, double scale) const {
  const Eigen::Index column = site % columns_, behind = columns_ - column;
  const auto about_first = about_first_.col(site / columns_);
  for (Eigen::Index row = 0; row < sum.size(); row += columns_) {
    sum.segment(row + column, behind) += scale * about_first.segment(row, behind);
    sum.segment(row, column) += scale * about_first.segment(row + behind, column);
  }
}

Neighborhoods::Neighborhoods(const SkinMechanics& mechanics) {
  const int markers = mechanics.marker_count(), sites = mechanics.site_count();
  const double unit = mechanics.length_unit();
  const auto of_markers = [&](int i, int j) {
    return (mechanics.RestMarker(i) - mechanics.RestMarker(j)).squaredNorm();
  };
  const auto along = [&](int i, int j) {
    const double off = mechanics.RestMarker(i).z() - mechanics.RestMarker(j).z();
    return off * off;
  };
  motion_near = Bells(markers, kSpreadMm * unit, of_markers);
  motion_alike = kMotionShare * Bells(markers, kMotionLengthMm * unit, of_markers);
  growth_alike = Bells(markers, kInflationLengthMm * unit, along);
  local_sites = SiteBells(mechanics, kLocalMm * unit);
  load_sites = SiteBells(mechanics, kHillMm * unit);
  local_markers.resize(sites, markers);
  for (int m = 0; m < markers; ++m) {
    for (int site = 0; site < sites; ++site)
      local_markers(site, m) =
          Bell((mechanics.RestSite(site) - mechanics.RestMarker(m)).squaredNorm(), kLocalMm * unit);
  }
}

std::shared_ptr<const Neighborhoods> Neighborhoods::SharedFor(const SkinMechanics& mechanics) {
  struct Entry {
    double unit = 0;
    std::vector<Vec3> places;  // of the sites and, behind them, the markers
    std::weak_ptr<const Neighborhoods> neighborhoods;
  };
  static std::mutex mutex;
  static std::vector<Entry> entries;  // guarded by mutex
  std::vector<Vec3> places;
  for (int site = 0; site < mechanics.site_count(); ++site) places.push_back(mechanics.RestSite(site));
  for (int m = 0; m < mechanics.marker_count(); ++m) places.push_back(mechanics.RestMarker(m));
  const std::lock_guard lock(mutex);
  std::erase_if(entries, [](const Entry& entry) { return entry.neighborhoods.expired(); });
  for (const Entry& entry : entries) {
    if (entry.unit != mechanics.length_unit() || entry.places != places) continue;
    if (auto shared = entry.neighborhoods.lock()) return shared;
  }
  auto made = std::make_shared<const Neighborhoods>(mechanics);
  entries.push_back({mechanics.length_unit(), std::move(places), made});
  return made;
}

}  // namespace taclink

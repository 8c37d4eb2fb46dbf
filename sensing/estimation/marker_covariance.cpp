#include "sensing/estimation/marker_covariance.h"

#include <cmath>

#include "sensing/shell/dense.h"

namespace taclink {
namespace {

// Found on three-dimensional solids (docs/reports/calculix.md); lengths and forces in SkinMechanics' units.
constexpr double kFloorMm = 0.02;
constexpr double kByMotion = 0.01;
constexpr double kSpreadShare = 0.5;  // of the error near a large motion
constexpr double kByInflation = 0.015, kLeastInflation = 0.3, kAxialShare = 0.5;
// At mid-length; without it drags of glued bodies were off, and wrong markers left phantoms.
constexpr double kBowMm = 0.2;
constexpr double kStrayN = 1e-3, kNormalShare = 0.01, kTangentialShare = 0.003;
// Of the stray forces where nothing presses: so little more of them that it is left out, four percent of
// the variance.
constexpr double kNegligibleStray = 0.2;
// And of noise and floor of one marker: what a stray force moves all of them by.
constexpr double kNegligibleStrayMotion = 0.35;
constexpr double kNegligibleMotion = 0.25;  // of the floor: an error by motion that is left out

}  // namespace

MarkerCovariance::MarkerCovariance(const SkinMechanics& mechanics, const Neighborhoods& near)
    : mechanics_(mechanics),
      near_(near),
      bow_mm_(Eigen::VectorXd::Zero(3 * mechanics.marker_count())),
      outward_(2, mechanics.marker_count()) {
  const double length_mm = mechanics.model().length_mm;
  for (int m = 0; m < mechanics.marker_count(); ++m) {
    outward_.col(m) = mechanics.RestMarker(m).head<2>().normalized();
    bow_mm_[3 * m + 2] =
        kBowMm * mechanics.length_unit() * std::sin(kPi * mechanics.RestMarker(m).z() / length_mm);
  }
  // Strays() selects sites in a checkerboard pattern with a period of two node columns.
  const int period = mechanics.mesh().refinement % 2 == 0 ? 1 : 2;
  if (mechanics.model().markers.paths % period == 0)
    spectrum_ = std::make_shared<const RingSpectrum>(mechanics, period);
}

void MarkerCovariance::SetState(const Linearization& skin, const UntouchedSkin& untouched) {
  const int markers = mechanics_.marker_count();
  moved_mm_.resize(markers);
  grown_mm_.resize(markers);
  for (int m = 0; m < markers; ++m) {
    const auto node = static_cast<size_t>(mechanics_.markers().node(m));
    moved_mm_[m] = kByMotion * (skin.state().mids_mm[node] - untouched.state.mids_mm[node]).norm();
    grown_mm_[m] = untouched.markers_mm.segment<3>(3 * m).norm();
  }
  moved_mm_ =
      moved_mm_.cwiseMax(kSpreadShare * (near_.motion_near * moved_mm_.asDiagonal()).rowwise().maxCoeff());
  const Eigen::Index paths = mechanics_.model().markers.paths;
  for (Eigen::Index first = 0; first < markers; first += paths) {
    auto ring = grown_mm_.segment(first, paths);
    ring.setConstant(ring.norm() / std::sqrt(static_cast<double>(paths)));
  }
  grown_mm_ = kByInflation * grown_mm_.cwiseMax(kLeastInflation * grown_mm_.maxCoeff());
}

void MarkerCovariance::WriteUntouched(const Linearization& skin, Eigen::MatrixXd& covariance_mm2) const {
  const int markers = mechanics_.marker_count();
  const double floor_mm = kFloorMm * mechanics_.length_unit();
  covariance_mm2.setZero(3 * markers, 3 * markers);
  for (int j = 0; j < markers; ++j) {
    const Vec2 out_j = outward_.col(j);
    for (int i = j; i < markers; ++i) {
      const double growth = grown_mm_[i] * grown_mm_[j] * near_.growth_alike(i, j);
      auto block = covariance_mm2.block<3, 3>(3 * i, 3 * j);
      block.topLeftCorner<2, 2>() = growth * outward_.col(i) * out_j.transpose();
      block(2, 2) = kAxialShare * kAxialShare * growth;
      if (i == j) block.diagonal().array() += floor_mm * floor_mm;
    }
  }
  covariance_mm2.selfadjointView<Eigen::Lower>().rankUpdate(bow_mm_);
  Eigen::MatrixXf stray_mm2 = Eigen::MatrixXf::Zero(bow_mm_.size(), bow_mm_.size());
  dense::AddOuter(UntouchedStrays(skin, mechanics_.columns()), stray_mm2);
  covariance_mm2.triangularView<Eigen::Lower>() += stray_mm2.cast<double>();
}

// Growth and bow are alike all around.
RingCovarianceParts MarkerCovariance::UntouchedParts(const Linearization& skin) const {
  const int paths = mechanics_.model().markers.paths, period = spectrum_->period();
  const double floor_mm = kFloorMm * mechanics_.length_unit();
  RingCovarianceParts parts;
  parts.columns = UntouchedStrays(skin, mechanics_.columns() / spectrum_->groups());
  parts.local.assign(static_cast<size_t>(mechanics_.marker_count() / paths),
                     floor_mm * floor_mm * Mat3::Identity());
  parts.common.setZero(spectrum_->block(), spectrum_->block());
  for (int i = 0; i < mechanics_.marker_count(); ++i) {
    if (i % paths >= period) continue;
    for (int j = 0; j < mechanics_.marker_count(); ++j) {
      if (j % paths >= period) continue;
      const double growth = grown_mm_[i] * grown_mm_[j] * near_.growth_alike(i, j);
      const Vec3 by_direction(growth, 0,
                              kAxialShare * kAxialShare * growth + bow_mm_[3 * i + 2] * bow_mm_[3 * j + 2]);
      parts.common.block<3, 3>(spectrum_->PlaceOf(i), spectrum_->PlaceOf(j)) = by_direction.asDiagonal();
    }
  }
  return parts;
}

Eigen::VectorXd MarkerCovariance::Direct(const Eigen::VectorXd& pulls_per_mm) const {
  const double floor_mm = kFloorMm * mechanics_.length_unit();
  const Eigen::Index markers = moved_mm_.size();
  const auto pulls = pulls_per_mm.reshaped(3, markers);  // by marker
  Eigen::Matrix3Xd moved = floor_mm * floor_mm * pulls;
  const Eigen::Matrix3Xd by_motion = (pulls * moved_mm_.asDiagonal()) * near_.motion_alike;
  moved += by_motion * moved_mm_.asDiagonal();
  Eigen::Matrix2Xd grown(2, markers);  // outward and along
  grown.row(0) = pulls.topRows<2>().cwiseProduct(outward_).colwise().sum();
  grown.row(1) = pulls.row(2);
  grown = ((grown * grown_mm_.asDiagonal()) * near_.growth_alike * grown_mm_.asDiagonal()).eval();
  moved.topRows<2>() += outward_ * grown.row(0).asDiagonal();
  moved.row(2) += kAxialShare * kAxialShare * grown.row(1);
  return moved.reshaped() + bow_mm_.dot(pulls_per_mm) * bow_mm_;
}

std::vector<MarkerCovariance::Stray> MarkerCovariance::Strays(const Eigen::VectorXd& local_n) const {
  const int around = mechanics_.columns();
  const double untouched_n = kStrayN * mechanics_.force_unit();
  std::vector<Stray> strays;
  for (int site = 0; site < mechanics_.site_count(); ++site) {
    strays.push_back({Linearization::kInward, site, untouched_n, kNormalShare * local_n[site]});
    // One of four neighbors stands for all (on either side of an odd seam, for three or five): along the wall
    // the skin is stiff, and they move markers alike.
    const int row = site / around, column = site % around;
    if ((row + column) % 2 != 0) continue;
    strays.push_back({row % 2 == 0 ? Linearization::kAround : Linearization::kAlong, site, 2 * untouched_n,
                      2 * kTangentialShare * local_n[site]});
  }
  return strays;
}

Eigen::MatrixXf MarkerCovariance::UntouchedStrays(const Linearization& skin, int columns) const {
  std::vector<Stray> strays = Strays(Eigen::VectorXd::Zero(mechanics_.site_count()));
  std::erase_if(strays, [&](const Stray& stray) { return stray.site % mechanics_.columns() >= columns; });
  LoadCases cases;
  for (const Stray& stray : strays) {
    cases.Begin();
    cases.Add(stray.site, stray.untouched_n * skin.ForceAt(stray.direction, stray.site));
  }
  return skin.Displacements(cases);
}

// Of the markers' covariance in one direction, by Cholesky with pivots: the largest variance that is left
// first, until what is left is little beside the floor. Markers move alike over a kernel's width, so that a
// dent needs few columns.
Eigen::MatrixXd MarkerCovariance::MotionColumns() const {
  const double least_mm = kNegligibleMotion * kFloorMm * mechanics_.length_unit();
  const Eigen::Index markers = moved_mm_.size();
  Eigen::VectorXd left_mm2 = near_.motion_alike.diagonal().cwiseProduct(moved_mm_.cwiseAbs2());
  Eigen::MatrixXd columns(markers, 0);
  while (columns.cols() < markers) {
    Eigen::Index pivot = 0;
    const double largest_mm2 = left_mm2.maxCoeff(&pivot);
    if (!(largest_mm2 > least_mm * least_mm)) break;
    Eigen::VectorXd column = moved_mm_[pivot] * near_.motion_alike.col(pivot).cwiseProduct(moved_mm_);
    column -= columns * columns.row(pivot).transpose();
    column /= std::sqrt(largest_mm2);
    left_mm2 -= column.cwiseAbs2();
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols<1>() = column;
  }
  return columns;
}

// The skin without loads is nearly one of revolution, so that one column of sites stands for all.
std::array<Eigen::VectorXd, 3> MarkerCovariance::StrayDisplacements(const Linearization& skin) const {
  constexpr std::array kDirections = {Linearization::kInward, Linearization::kAround, Linearization::kAlong};
  LoadCases cases;
  for (int row = 0; row < mechanics_.site_rows(); ++row) {
    for (const auto direction : kDirections) {
      cases.Begin();
      cases.Add(row * mechanics_.columns(), skin.ForceAt(direction, row * mechanics_.columns()));
    }
  }
  const Eigen::RowVectorXf norms = skin.Displacements(cases).colwise().norm();
  std::array<Eigen::VectorXd, 3> by_direction;
  for (const auto direction : kDirections)
    by_direction[direction] = norms(Eigen::seq(direction, Eigen::last, 3)).transpose().cast<double>();
  return by_direction;
}

Eigen::MatrixXf MarkerCovariance::ColumnsOfLoads(const Linearization& skin, const Eigen::VectorXd& local_n,
                                                 const std::array<Eigen::VectorXd, 3>& mm_per_n,
                                                 double noise_mm) {
  for (auto& sigmas : stray_n_) sigmas.setZero(mechanics_.site_count());
  const double least_mm = kNegligibleStrayMotion * std::hypot(noise_mm, kFloorMm * mechanics_.length_unit());
  LoadCases cases;
  for (const Stray& stray : Strays(local_n)) {
    double& sigma_n = stray_n_[stray.direction][stray.site];
    sigma_n = stray.untouched_n;
    const double moved_mm = stray.local_n * mm_per_n[stray.direction][stray.site / mechanics_.columns()];
    if (stray.local_n < kNegligibleStray * stray.untouched_n || moved_mm < least_mm) continue;
    sigma_n = std::hypot(stray.local_n, stray.untouched_n);
    cases.Begin();
    cases.Add(stray.site, stray.local_n * skin.ForceAt(stray.direction, stray.site));
  }
  const Eigen::MatrixXf motion = MotionColumns().cast<float>();
  const Eigen::Index directions = 3 * motion.cols();
  Eigen::MatrixXf columns(bow_mm_.size(), directions + cases.count());
  columns.leftCols(directions).setZero();
  for (Eigen::Index k = 0; k < directions; ++k)
    columns.col(k)(Eigen::seq(k % 3, Eigen::last, 3)) = motion.col(k / 3);
  columns.rightCols(cases.count()) = skin.Displacements(cases);
  return columns;
}

// Most sites bear nothing.
Eigen::VectorXd MarkerCovariance::LocalOfSites(const Eigen::VectorXd& forces_n) const {
  Eigen::VectorXd local_n = Eigen::VectorXd::Zero(forces_n.size());
  for (Eigen::Index site = 0; site < forces_n.size(); ++site) {
    if (forces_n[site] != 0) near_.local_sites.AddTo(local_n, static_cast<int>(site), forces_n[site]);
  }
  return local_n;
}

}  // namespace taclink

#include "sensing/estimation/marker_covariance.h"

#include <cmath>
#include <numeric>

#include "sensing/mechanics/dense.h"

namespace taclink {
namespace {

// Found on three-dimensional solids (docs/calculix.md); lengths and forces in SkinMechanics' units.
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
}

void MarkerCovariance::SetState(const Linearization& skin, const InflatedSkin& inflated) {
  const int markers = mechanics_.marker_count();
  moved_mm_.resize(markers);
  grown_mm_.resize(markers);
  for (int m = 0; m < markers; ++m) {
    const auto node = static_cast<size_t>(mechanics_.markers().node(m));
    moved_mm_[m] = kByMotion * (skin.state().mids_mm[node] - inflated.state.mids_mm[node]).norm();
    grown_mm_[m] = inflated.markers_mm.segment<3>(3 * m).norm();
  }
  moved_mm_ =
      moved_mm_.cwiseMax(kSpreadShare * (near_.motion_near * moved_mm_.asDiagonal()).rowwise().maxCoeff());
  grown_mm_ = kByInflation * grown_mm_.cwiseMax(kLeastInflation * grown_mm_.maxCoeff());
}

void MarkerCovariance::WriteDirect(Eigen::MatrixXd& covariance_mm2) const {
  const int markers = mechanics_.marker_count();
  const double floor_mm = kFloorMm * mechanics_.length_unit();
  covariance_mm2.setZero(3 * markers, 3 * markers);
  for (int j = 0; j < markers; ++j) {
    const Vec2 out_j = outward_.col(j);
    for (int i = j; i < markers; ++i) {
      const double growth = grown_mm_[i] * grown_mm_[j] * near_.growth_alike(i, j);
      Mat3 block = moved_mm_[i] * moved_mm_[j] * near_.motion_alike(i, j) * Mat3::Identity();
      block.topLeftCorner<2, 2>() += growth * outward_.col(i) * out_j.transpose();
      block(2, 2) += kAxialShare * kAxialShare * growth;
      if (i == j) block.diagonal().array() += floor_mm * floor_mm;
      covariance_mm2.block<3, 3>(3 * i, 3 * j) = block;
    }
  }
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
  return moved.reshaped();
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

Eigen::MatrixXf MarkerCovariance::UntouchedStray(Linearization& skin) const {
  std::vector<int> sites(static_cast<size_t>(mechanics_.site_count()));
  std::iota(sites.begin(), sites.end(), 0);
  skin.MakeColumns(sites);
  const std::vector<Stray> strays = Strays(Eigen::VectorXd::Zero(mechanics_.site_count()));
  const Eigen::Index rows = bow_mm_.size();
  Eigen::MatrixXf scaled(rows, static_cast<Eigen::Index>(strays.size()));
  Eigen::Index used = 0;
  for (const Stray& stray : strays)
    scaled.col(used++) = static_cast<float>(stray.untouched_n) * skin.Column(stray.direction, stray.site);
  Eigen::MatrixXf covariance_mm2 = Eigen::MatrixXf::Zero(rows, rows);
  dense::AddOuter(scaled, covariance_mm2);
  return covariance_mm2;
}

void MarkerCovariance::AddStray(Linearization& skin, const Eigen::VectorXd& local_n,
                                const Eigen::MatrixXf& untouched_mm2, Eigen::MatrixXd& covariance_mm2) {
  for (auto& sigmas : stray_n_) sigmas.setZero(mechanics_.site_count());
  std::vector<Stray> strays = Strays(local_n);
  for (const Stray& stray : strays)
    stray_n_[stray.direction][stray.site] = std::hypot(stray.local_n, stray.untouched_n);
  std::erase_if(strays,
                [](const Stray& stray) { return stray.local_n < kNegligibleStray * stray.untouched_n; });
  std::vector<int> sites;
  for (const Stray& stray : strays) sites.push_back(stray.site);
  skin.MakeColumns(sites);
  Eigen::MatrixXf stray_mm2 = untouched_mm2;
  Eigen::MatrixXf scaled(covariance_mm2.rows(), static_cast<Eigen::Index>(strays.size()));
  Eigen::Index used = 0;
  for (const Stray& stray : strays)
    scaled.col(used++) = static_cast<float>(stray.local_n) * skin.Column(stray.direction, stray.site);
  dense::AddOuter(scaled, stray_mm2);
  covariance_mm2.triangularView<Eigen::Lower>() += stray_mm2.cast<double>();
}

// Most sites bear nothing.
Eigen::VectorXd MarkerCovariance::LocalOfSites(const Eigen::VectorXd& forces_n) const {
  Eigen::VectorXd local_n = Eigen::VectorXd::Zero(forces_n.size());
  for (Eigen::Index site = 0; site < forces_n.size(); ++site) {
    if (forces_n[site] != 0) local_n += forces_n[site] * near_.local_sites.col(site);
  }
  return local_n;
}

}  // namespace taclink

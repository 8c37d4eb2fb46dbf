#include "sensing/estimation/marker_covariance.h"

#include <cmath>

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

}  // namespace

MarkerCovariance::MarkerCovariance(const SkinMechanics& mechanics, const Neighborhoods& near)
    : mechanics_(mechanics), near_(near), bow_mm_(Eigen::VectorXd::Zero(3 * mechanics.marker_count())) {
  const double length_mm = mechanics.model().length_mm;
  for (int m = 0; m < mechanics.marker_count(); ++m)
    bow_mm_[3 * m + 2] =
        kBowMm * mechanics.length_unit() * std::sin(kPi * mechanics.RestMarker(m).z() / length_mm);
}

void MarkerCovariance::WriteDirect(const Linearization& skin, const InflatedSkin& inflated,
                                   Eigen::MatrixXd& covariance_mm2) const {
  const int markers = mechanics_.marker_count();
  const double floor_mm = kFloorMm * mechanics_.length_unit();
  Eigen::VectorXd moved(markers), grown(markers);
  for (int m = 0; m < markers; ++m) {
    const auto node = static_cast<size_t>(mechanics_.markers().node(m));
    moved[m] = kByMotion * (skin.state().mids_mm[node] - inflated.state.mids_mm[node]).norm();
    grown[m] = inflated.markers_mm.segment<3>(3 * m).norm();
  }
  moved = moved.cwiseMax(kSpreadShare * (near_.motion_near * moved.asDiagonal()).rowwise().maxCoeff());
  grown = kByInflation * grown.cwiseMax(kLeastInflation * grown.maxCoeff());
  covariance_mm2.setZero(3 * markers, 3 * markers);
  for (int j = 0; j < markers; ++j) {
    const Vec3 out_j = Vec3(mechanics_.RestMarker(j).x(), mechanics_.RestMarker(j).y(), 0).normalized();
    for (int i = j; i < markers; ++i) {
      const Vec3 out_i = Vec3(mechanics_.RestMarker(i).x(), mechanics_.RestMarker(i).y(), 0).normalized();
      const double growth = grown[i] * grown[j] * near_.growth_alike(i, j);
      Mat3 block = moved[i] * moved[j] * near_.motion_alike(i, j) * Mat3::Identity();
      block.topLeftCorner<2, 2>() += growth * out_i.head<2>() * out_j.head<2>().transpose();
      block(2, 2) += kAxialShare * kAxialShare * growth;
      if (i == j) block.diagonal().array() += floor_mm * floor_mm;
      covariance_mm2.block<3, 3>(3 * i, 3 * j) = block;
    }
  }
}

void MarkerCovariance::AddStray(const Linearization& skin, const Eigen::VectorXd& local_n,
                                Eigen::MatrixXd& covariance_mm2) {
  const int sites = mechanics_.site_count(), around = mechanics_.columns();
  for (auto& sigmas : stray_n_) sigmas.setZero(sites);
  Eigen::MatrixXf scaled(covariance_mm2.rows(), 2 * sites);
  Eigen::Index used = 0;
  const auto add = [&](Linearization::Direction direction, int site, double share, double of_sites) {
    const double sigma_n =
        std::sqrt(of_sites) * std::hypot(share * local_n[site], kStrayN * mechanics_.force_unit());
    stray_n_[direction][site] = sigma_n;
    scaled.col(used++) = static_cast<float>(sigma_n) * skin.Column(direction, site);
  };
  for (int site = 0; site < sites; ++site) {
    add(Linearization::kInward, site, kNormalShare, 1);
    // One of four neighbors stands for all (on either side of an odd seam, for three or five): along the wall
    // the skin is stiff, and they move markers alike.
    const int row = site / around, column = site % around;
    if ((row + column) % 2 == 0)
      add(row % 2 == 0 ? Linearization::kAround : Linearization::kAlong, site, kTangentialShare, 4);
  }
  scaled.conservativeResize(Eigen::NoChange, used);
  Eigen::MatrixXf stray_mm2 = Eigen::MatrixXf::Zero(covariance_mm2.rows(), covariance_mm2.rows());
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

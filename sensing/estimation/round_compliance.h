#pragma once

#include <memory>

#include "sensing/estimation/skin_compliance.h"
#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// At an inflated skin, by harmonics. A skin of revolution with its markers, turned by the angle between two
/// paths of markers, is itself: what loads at the sites between two paths do is computed, and turned for the
/// others.
class RoundCompliance final : public SkinCompliance {
 public:
  /// `mechanics`: referred to.
  RoundCompliance(const SkinMechanics& mechanics, std::shared_ptr<const InflatedSkin> skin);

  const InflatedSkin& skin() const { return *skin_; }
  void Solve(const Eigen::VectorXd& forces, Eigen::VectorXd& motion) const override {
    skin_->stiffness.Solve(forces, motion);
  }
  const MarkerMap::Jacobian& jacobian() const override { return jacobian_; }
  Eigen::MatrixXf Displacements(const LoadCases& cases) const override;

  /// Up to this many loads per case, superposing the responses of their sites costs less than Solve.
  static constexpr size_t kFewLoads = 48;
  /// Adds J K^-1 by the unknowns of a site's node in cylindrical coordinates: 3 markers x 5.
  void AddResponses(int site, Eigen::Ref<Eigen::MatrixXf> responses) const;

  using NodeBlock = Eigen::Matrix<float, kNodeDofs, kNodeDofs>;
  /// Of K^-1, in cylindrical coordinates: what loads on a site's node move another's. All blocks are made
  /// when the first is asked for.
  NodeBlock BlockOf(int moved_site, int loaded_site) const;

 private:
  void MakeResponses() const;
  void AddDisplacements(int site, const LoadCases::OnSite& on, Eigen::MatrixXf& displacements) const;
  void AddTurned(const float* from, int by, float* to) const;

  const SkinMechanics& mechanics_;
  const std::shared_ptr<const InflatedSkin> skin_;
  const int parts_, paths_;  // columns of nodes between paths of markers; paths
  MarkerMap::Jacobian jacobian_;
  mutable Eigen::MatrixXf responses_;  // J K^-1 of the sites between the first two paths; empty: not made
  mutable Eigen::MatrixXf inverse_;    // RingStiffness::Inverse(); empty: not made
};

}  // namespace taclink

#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sensing/estimation/skin_mechanics.h"
#include "sensing/shell/energy_search.h"
#include "sensing/shell/ring_stiffness.h"

namespace taclink {

/// What cameras say of the markers: displacement from the slack skin, and its information (inverse
/// covariance, 1/mm^2; rank 2 where one camera saw it, 0: not seen). By marker index, link frame.
struct MarkerObservations {
  std::vector<Vec3> displacement_mm;
  std::vector<Mat3> information;
};

/// The shell's shape when springs pull its markers to where they are seen:
///   min  Pi(u, q) + 1/2 sum_m (m(u) - d)' W_m (m(u) - d),
/// by EnergySearch with one constant Hessian, that of the inflated skin with all springs: the springs hold
/// the modes in which the touched skin's stiffness is another. Springs and not loads: nothing has to be known
/// of where something touches, and no start from an earlier frame is needed. The springs stretch by
/// force / stiffness, so that the shape is a good place to linearize at, not an answer. One thread.
class Assimilation {
 public:
  explicit Assimilation(const SkinMechanics& mechanics);

  using Summary = EnergySearch::Summary;
  /// From `state`, under the known loads of `untouched`. Sets `pulls_n`: the springs' forces on the markers,
  /// stacked.
  Summary Run(const MarkerObservations& observed, const UntouchedSkin& untouched, ShellState& state,
              Eigen::VectorXd& pulls_n);

 private:
  double Value(const MarkerObservations& observed, const KnownLoads& known, const ShellState& state,
               Eigen::VectorXd& gradient);
  bool Factorize(const InflatedSkin& skin);
  void SetSprings(const MarkerObservations& observed);

  const SkinMechanics& mechanics_;
  const double spring_n_mm_;  // of a marker that is seen well
  EnergySearch search_;
  RingStiffness stiffness_;                       // with springs
  std::shared_ptr<const InflatedSkin> factored_;  // of which stiffness_ is; null: of none
  std::vector<Mat3> springs_;
  Eigen::VectorXd markers_mm_;
};

}  // namespace taclink

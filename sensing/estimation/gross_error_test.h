#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "sensing/estimation/camera_modes.h"
#include "sensing/estimation/tangent.h"
#include "sensing/estimation/whitening.h"

namespace taclink {

/// Tests, before any load is looked for, whether loads can have moved the markers so: the overall model test
/// of geodetic networks [baarda1968], with forces of 0.05 N (standard deviation; times
/// SkinMechanics::force_unit) at every site and in every direction, to first order about the untouched skin.
/// Images that are torn, shifted, of two moments or labeled wrongly fail it. One thread.
class GrossErrorTest {
 public:
  explicit GrossErrorTest(const SkinMechanics& mechanics)
      : mechanics_(mechanics), camera_modes_(mechanics.model()) {}

  /// The squared Mahalanobis distance of the markers, per number that is seen. `untouched`: prepared for the
  /// problem. nullopt: the untouched skin is not of revolution, which the test requires.
  std::optional<double> Chi2PerDof(const SkinProblem& problem, const Tangent& untouched);
  /// Chi2PerDof is beyond what any skin comes to.
  bool Fails(const SkinProblem& problem, const Tangent& untouched);

 private:
  bool Prepare(const Tangent& untouched);

  const SkinMechanics& mechanics_;
  CameraModes camera_modes_;
  /// Of which `covariance_` and `noise_mm2_` are; null: of none.
  std::shared_ptr<const UntouchedCovariance> prepared_for_;
  std::shared_ptr<const RingCovariance> covariance_;  // with forces, without the known loads' errors
  std::vector<Mat3> noise_mm2_;                       // that it contains, by marker
  Whitening whitening_;
};

}  // namespace taclink

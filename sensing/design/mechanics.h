#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/design/resolution.h"
#include "sensing/estimation/skin_estimator.h"

namespace taclink {

/// Range of gauge pressure in which a skin has a stable, axisymmetric equilibrium that it reaches from the
/// slack state. None: no limit within +- `searched_mpa`.
struct PressureLimits {
  double searched_mpa = 0;
  /// Negative: the skin buckles under suction.
  std::optional<double> buckles_mpa;
  /// Positive: beyond it there is no stable equilibrium, or the skin grows by more than half its radius.
  std::optional<double> runs_away_mpa;
};

/// Required ratio of the pressure at which a skin runs away to its highest operating pressure.
inline constexpr double kPressureReserve = 1.3;

/// `shell`: meshed in rings (RingBlocks::Fit). Accurate to 1 % of `most_mpa`.
PressureLimits FindPressureLimits(const NonlinearShell& shell, double most_mpa);

/// Attitudes of the axis in which sag is computed: weight along +Z, along -Z, or across the axis.
enum class Attitude : uint8_t { kUpright = 0, kHanging = 1, kLying = 2 };
inline constexpr std::array<Attitude, 3> kAttitudes = {Attitude::kUpright, Attitude::kHanging,
                                                       Attitude::kLying};
const char* Name(Attitude attitude);
Vec3 WeightDirection(Attitude attitude);

struct WeightSag {
  double mass_kg = 0;
  /// Largest displacement of a marker, by attitude, mm. None: no stable equilibrium clear of the tube.
  std::array<std::optional<double>, kAttitudes.size()> sag_mm;
};
/// Sag of the skin under its weight, at this pressure. None: the model has no density.
std::optional<WeightSag> FindWeightSag(SkinMechanics& mechanics, double pressure_mpa);

/// Forces at the markers of one ring.
struct RingForce {
  /// The weakest inward force that is detected 95 times in 100 at every place of the ring
  /// (LoadEstimator::Limits), N. None: see SkinForces::problem.
  std::optional<double> least_n;
  double room_mm = 0;  ///< from the dome's top to the tube (or the axis), undeformed
  /// Deepest push of a disc, from the surface under the loads, before a dome meets the tube or the force
  /// stops rising; and the force there. None: no equilibrium was found even for a shallow push.
  std::optional<double> range_mm, range_n;
  /// What limits the range: the solver found no equilibrium, a dome met the tube, or the force fell (the dent
  /// snaps).
  enum class End : uint8_t { kNotSolved, kTube, kSnap };
  End end = End::kNotSolved;
};

struct SkinForces {
  KnownLoads loads;
  double growth_mm = 0;            ///< largest outward displacement of a marker by the loads
  std::vector<RingForce> by_ring;  ///< empty: no equilibrium under these loads, or not computed
  std::optional<std::string> problem;
};

/// Detection limit and range by ring, under known loads. `resolutions`: of the markers under these loads.
SkinForces FindForces(SkinEstimator& estimator, const KnownLoads& loads,
                      const std::vector<MarkerResolution>& resolutions, double disc_diameter_mm);

}  // namespace taclink

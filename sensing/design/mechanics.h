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

/// Gauge pressures up to which a slack skin has a stable, axisymmetric equilibrium that it grows into. None:
/// within +- `searched_mpa` it has one.
struct PressureLimits {
  double searched_mpa = 0;
  /// Negative: the skin buckles under suction.
  std::optional<double> buckles_mpa;
  /// Positive: beyond, there is no stable equilibrium, or the skin grows by more than half its radius.
  std::optional<double> runs_away_mpa;
};

/// Of the pressure at which a skin runs away, over the highest that it is meant for.
inline constexpr double kPressureReserve = 1.3;

/// `shell`: meshed in rings (RingBlocks::Fit). To 1 % of `most_mpa`.
PressureLimits FindPressureLimits(const NonlinearShell& shell, double most_mpa);

/// How the skin's weight moves it where the axis stands or lies; weight falls along +Z, -Z, or across.
enum class Attitude : uint8_t { kUpright = 0, kHanging = 1, kLying = 2 };
inline constexpr std::array<Attitude, 3> kAttitudes = {Attitude::kUpright, Attitude::kHanging,
                                                       Attitude::kLying};
const char* Name(Attitude attitude);
Vec3 WeightDirection(Attitude attitude);

struct WeightSag {
  double mass_kg = 0;
  /// Longest way of a marker, by attitude, mm. None: no stable equilibrium that is clear of the tube.
  std::array<std::optional<double>, kAttitudes.size()> sag_mm;
};
/// Under that pressure. None: the model has no density.
std::optional<WeightSag> FindWeightSag(SkinMechanics& mechanics, double pressure_mpa);

/// At a ring's markers.
struct RingForce {
  /// The weakest inward force that is detected 95 times in 100 wherever on the ring it acts
  /// (LoadEstimator::Limits), N. None: see SkinForces::problem.
  std::optional<double> least_n;
  double room_mm = 0;  ///< from the dome's top to the tube (or the axis), on the undeformed skin
  /// How far a disc can press from the surface under the loads: until a dome meets the tube or the force
  /// stops rising; and the force there. None: no equilibrium was found even for a shallow push.
  std::optional<double> range_mm, range_n;
  /// What ended the way: a dome met the tube, the force fell (the dent snaps), or the solver found no
  /// equilibrium.
  enum class End : uint8_t { kNotSolved, kTube, kSnap };
  End end = End::kNotSolved;
};

struct SkinForces {
  KnownLoads loads;
  double growth_mm = 0;            ///< longest way of a marker away from the axis, by the loads
  std::vector<RingForce> by_ring;  ///< empty: the skin does not stand these loads
  std::optional<std::string> problem;
};

/// What the skin feels under known loads. `resolutions`: of its markers under these loads.
SkinForces FindForces(SkinEstimator& estimator, const KnownLoads& loads,
                      const std::vector<MarkerResolution>& resolutions, double disc_diameter_mm);

}  // namespace taclink

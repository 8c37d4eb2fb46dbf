#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>

#include "sensing/estimation/skin_mechanics.h"
#include "sensing/shell/inflated_skin.h"
#include "sensing/shell/ring_equilibrium.h"

namespace taclink {

/// Finds the equilibrium under any known loads. Under pressure alone the skin is axisymmetric (InflatedSkin);
/// those of the last pressures, on a fine grid, are kept. RingEquilibrium then solves for the given loads
/// with the stiffness of the inflated skin, started from a first-order expansion about the nearest point of a
/// grid of loads. The result is an equilibrium of exactly these loads, which is stable and clear
/// of the tube. Not thread-safe.
class UntouchedSkins {
 public:
  /// Referred to.
  explicit UntouchedSkins(const SkinMechanics& mechanics);
  ~UntouchedSkins();

  /// See SkinMechanics::Untouched. Valid until the next call.
  const UntouchedSkin* Find(const KnownLoads& loads);

 private:
  /// Pressure in parts of a step, specific force in steps.
  using GridPoint = std::array<int, KnownLoads::kCount>;
  struct Answer {
    bool is_found = false;
    UntouchedSkin skin;
    Eigen::MatrixX4f motion;  // derivatives of the degrees of freedom by the known loads
    double stability = 0;     // see RingEquilibrium
    uint64_t used = 0;        // when, in calls; 0: never
  };

  using Inflation = std::shared_ptr<const InflatedSkin>;

  Inflation Inflated(int part);
  Inflation Base(double pressure_mpa);
  const Answer* Expanded(const GridPoint& point);
  const UntouchedSkin* FindAt(const KnownLoads& loads);
  bool Solve(const InflatedSkin& base, const KnownLoads& loads, ShellState& state);
  bool IsClearOfTube(const ShellState& state) const;
  bool WriteStability(const InflatedSkin& base, Answer& answer);
  bool WriteDerivatives(const Inflation& base, Answer& answer);
  const UntouchedSkin* FindUnderLessSuction(KnownLoads loads);

  const SkinMechanics& mechanics_;
  const double part_mpa_;
  const bool is_round_;  // a surface of revolution, as MakeShellMesh makes; else Find returns nullptr
  double specific_force_step_mps2_ = 0;  // 0: the skin has no weight
  RingEquilibrium equilibrium_;
  MarkerMap::Jacobian jacobian_;
  ByKnownLoads gradient_, motion_, by_base_;
  struct CachedInflation {
    Inflation skin;     // nullptr: no stable equilibrium exists
    uint64_t used = 0;  // when, in calls
  };
  std::map<int, CachedInflation> inflated_;  // by parts
  std::map<GridPoint, Answer> expansions_;
  uint64_t calls_ = 0;
  std::array<Answer, 8> recent_;  // to what was asked for last
};

}  // namespace taclink

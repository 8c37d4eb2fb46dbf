#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>

#include "sensing/estimation/skin_mechanics.h"
#include "sensing/shell/equilibrium.h"
#include "sensing/shell/inflated_skin.h"
#include "sensing/shell/ring_equilibrium.h"

namespace taclink {

/// Finds the equilibrium under any known loads. Under pressure alone the skin is axisymmetric (InflatedSkin);
/// those of the last pressures, on a fine grid, are kept. RingEquilibrium then solves for the given loads
/// with the stiffness of the inflated skin, started from a first-order expansion about the nearest point of a
/// grid of loads (Expansion). The result is an equilibrium of exactly these loads. Not thread-safe.
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
  /// How an equilibrium was found.
  enum class Way {
    kNone,      ///< not found
    kFromBase,  ///< with the stiffness of the skin under pressure alone
    kInSteps,   ///< by load steps and Newton's method: a skin that sags far has another stiffness
  };
  /// An equilibrium with the derivatives of its degrees of freedom by the known loads.
  struct Expansion {
    Way way = Way::kNone;
    UntouchedSkin skin;
    ByKnownLoads motion;
    uint64_t used = 0;  // when, in calls
  };

  class Pressure;

  using Inflation = std::shared_ptr<const InflatedSkin>;

  Inflation Inflated(int part);
  Inflation Base(double pressure_mpa);
  const Expansion* Expanded(const GridPoint& point);
  const UntouchedSkin* FindAt(const KnownLoads& loads);
  Way SolveFromBase(const InflatedSkin& base, const KnownLoads& loads, ShellState& state);
  bool SolveNear(const Expansion& near, const InflatedSkin& base, const KnownLoads& loads, ShellState& state);
  bool SolveBySteps(const ShellState& from, const KnownLoads& from_loads, int steps, const KnownLoads& loads,
                    ShellState& state);
  /// False: the equilibrium is not stable.
  bool WriteDerivatives(const Inflation& base, Way way, UntouchedSkin& skin, ByKnownLoads& motion);

  const SkinMechanics& mechanics_;
  const double part_mpa_;
  const bool is_round_;  // a surface of revolution, as MakeShellMesh makes; else Find returns nullptr
  double specific_force_step_mps2_ = 0;  // 0: the skin has no weight
  RingEquilibrium equilibrium_;
  std::unique_ptr<EquilibriumSolver> in_steps_;  // made when it is asked for
  MarkerMap::Jacobian jacobian_;
  ByKnownLoads gradient_, motion_, by_base_;
  /// Null if there is no equilibrium.
  struct CachedInflation {
    Inflation skin;
    uint64_t used = 0;  // when, in calls
  };
  std::map<int, CachedInflation> inflated_;  // by parts
  std::map<GridPoint, Expansion> expansions_;
  uint64_t calls_ = 0;
  /// Found last; used 0: nothing.
  struct Recent {
    UntouchedSkin skin;
    uint64_t used = 0;  // when, in calls
  };
  std::array<Recent, 4> recent_;
};

}  // namespace taclink

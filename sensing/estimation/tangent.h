#pragma once

#include <Eigen/Core>
#include <memory>

#include "sensing/estimation/assimilation.h"
#include "sensing/estimation/linearization.h"
#include "sensing/estimation/load_estimator.h"
#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// What one frame asks.
struct SkinProblem {
  MarkerObservations observed = {};  ///< from the slack skin
  UntouchedSkin untouched = {};      ///< the skin under `loads` alone
  KnownLoads loads = {};  ///< those of `untouched`: as measured, or fitted where they are not known well
  KnownLoadsPrior prior = {};
};

/// A linearized skin with all that its loads are weighed with. It is made of one frame and good for others
/// that are near. One thread at a time.
struct Tangent {
  /// Good enough within `reach` of where it was made, in SkinMechanics' units. Both are referred to.
  Tangent(const SkinMechanics& mechanics, const Neighborhoods& near, double reach);

  double DistanceMm(const ShellState& state) const;
  bool IsNear(const ShellState& state) const;
  /// The model's errors are still about the same where `now` acts: force in the neighborhood of each site.
  /// `share`: of what is allowed.
  bool HasLocal(const Eigen::VectorXd& now, double share = 1) const;
  /// Both, and the cameras see as much.
  bool IsGoodFor(const SkinProblem& problem, const ShellState& state) const;
  /// What is near keeps its columns: only what the loads are weighed with is made again.
  /// `untouched`: the tangent of the skin without loads; null: this is that.
  /// `bodies`: about how many press.
  bool Make(const SkinProblem& problem, const ShellState& state, const Eigen::VectorXd& local,
            Tangent* untouched, size_t bodies = 1);
  /// Of the skin without loads, at `state`: that of the problem or the slack one. Made of its inflated skin,
  /// where it has one, so that it is good for any attitude.
  bool MakeUntouched(const SkinProblem& problem, const ShellState& state);
  void Forget();

  const double reach_mm, force_unit;
  Linearization skin;
  LoadEstimator loads;
  bool is_prepared = false;
  Eigen::VectorXd local_n;

 private:
  bool Linearize(const SkinProblem& problem, const ShellState& state, const Tangent* untouched,
                 size_t bodies);
};

}  // namespace taclink

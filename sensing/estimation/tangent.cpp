#include "sensing/estimation/tangent.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace taclink {
namespace {

constexpr double kSameLocal = 0.5;  // of the local forces: the model's errors are still the same
constexpr double kLittleLocalN = 0.05;
constexpr size_t kPatchSites = 37, kMostPatchSites = 3 * kPatchSites;  // for each body, and for all
// By so much a skin may change, in SkinMechanics' units, before it is stiffer than without loads; slack, and
// more for each of SkinMechanics::pressure_step.
constexpr double kAsStiffMm = 0.8, kAsStiffMmPerStep = 1;

}  // namespace

Tangent::Tangent(const SkinMechanics& mechanics, const Neighborhoods& near, double reach)
    : reach_mm(reach * mechanics.length_unit()),
      force_unit(mechanics.force_unit()),
      skin(mechanics),
      loads(mechanics, near) {}

double Tangent::DistanceMm(const ShellState& state) const {
  const std::vector<Vec3>&a = skin.tangent_state().mids_mm, &b = state.mids_mm;
  if (a.size() != b.size()) return std::numeric_limits<double>::max();
  double longest2 = 0;
  for (size_t i = 0; i < a.size(); ++i) longest2 = std::max(longest2, (a[i] - b[i]).squaredNorm());
  return std::sqrt(longest2);
}

bool Tangent::IsNear(const ShellState& state) const {
  return skin.is_made() && DistanceMm(state) < reach_mm;
}

bool Tangent::HasLocal(const Eigen::VectorXd& now, double share) const {
  return local_n.size() == now.size() &&
         (now - local_n).cwiseAbs().maxCoeff() <
             share * (kSameLocal * std::max(now.maxCoeff(), local_n.maxCoeff()) + kLittleLocalN * force_unit);
}

bool Tangent::IsGoodFor(const SkinProblem& problem, const ShellState& state) const {
  return is_prepared && IsNear(state) && loads.IsPreparedFor(problem.observed, problem.prior);
}

bool Tangent::Make(const SkinProblem& problem, const ShellState& state, const Eigen::VectorXd& local,
                   Tangent* untouched, size_t bodies) {
  const bool is_kept = is_prepared && IsNear(state);
  local_n = local;
  // The model's errors are those at `state`, whichever state the last step was from.
  is_prepared =
      (is_kept ? skin.Rebase(state, problem.loads) : Linearize(problem, state, untouched, bodies)) &&
      loads.Prepare(skin, problem.untouched, problem.observed, problem.prior, local,
                    untouched ? untouched->loads.untouched() : nullptr);
  return is_prepared;
}

// By a patch where all else is about as stiff as where nothing touches: the more the skin is inflated, the
// more it may have moved.
bool Tangent::Linearize(const SkinProblem& problem, const ShellState& state, const Tangent* untouched,
                        size_t bodies) {
  const auto round = untouched != nullptr ? untouched->skin.round() : nullptr;
  const size_t patch_sites = kPatchSites * std::max<size_t>(1, bodies);
  if (!round || patch_sites > kMostPatchSites) return skin.At(state, problem.loads);
  const SkinMechanics& mechanics = skin.mechanics();
  StatePatch patch = PatchBetween(mechanics, round->skin().state, state, patch_sites);
  const double most_mm =
      kAsStiffMm + kAsStiffMmPerStep * round->skin().pressure_mpa / mechanics.pressure_step();
  if (patch.outside_mm > most_mm * mechanics.length_unit()) return skin.At(state, problem.loads);
  return skin.At(state, problem.loads, round, std::move(patch.sites));
}

bool Tangent::MakeUntouched(const SkinProblem& problem, const ShellState& state) {
  const std::shared_ptr<const InflatedSkin> inflated = problem.untouched.inflated();
  const bool is_kept = is_prepared && IsNear(inflated ? inflated->state : state);
  local_n = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(skin.frames().size()));
  const bool is_made =
      is_kept || (inflated ? skin.At(inflated, problem.loads) : skin.At(state, problem.loads));
  is_prepared = is_made && skin.Rebase(state, problem.loads) &&
                loads.Prepare(skin, problem.untouched, problem.observed, problem.prior, local_n, nullptr);
  return is_prepared;
}

void Tangent::Forget() {
  is_prepared = false;
  local_n.resize(0);
  loads.Forget();
}

}  // namespace taclink

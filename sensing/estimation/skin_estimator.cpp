#include "sensing/estimation/skin_estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/estimation/known_loads_fit.h"

namespace taclink {
namespace {

// In units of length (SkinMechanics) where mm.
constexpr double kNextStepMm = 0.02;  // of the next step
constexpr double kTangentErrorPerMm =
    0.2;                                  // share of a step that a tangent gets wrong, by how far it is from
constexpr double kNearlySettledMm = 0.3;  // of the last step, when they run out
constexpr double kUnlimitedMm = 1e9;
constexpr double kTouchedReachMm = 2.5;  // from where the touched skin's tangent was made: it is good enough
constexpr double kModelPressureShare = 0.01;  // of the pressure: what the model's inflation is wrong by
constexpr double kLeastPressureSigma =
    1e-3;  // of the steps in which the skin is inflated: a prior is no certainty
constexpr int kMostSteps = 16, kMostTangents = 5;
constexpr double kLeastStepMm = 0.3;
constexpr int kStepsOfTangent = 3;  // the least: a new one is a disturbance where a skin may buckle
constexpr double kShrinks = 0.5;    // steps by less: the tangent is too old
// Likewise where the skin nearly rests: a new tangent may choose other loads, which lead elsewhere where
// bodies hide the markers between them.
constexpr double kShrinksNearEnd = 0.9;
constexpr double kArrivingMm = 1;  // of a step: a tangent that is made where it leads will be near the end
// Between the last two steps, of the loads in any neighborhood by the largest, and of a seen marker: settled.
constexpr double kSameLoads = 0.1, kSeenSettledMm = 0.2;

double LongestOff(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  if (a.size() != b.size()) return 1e9;
  double longest2 = 0;
  for (size_t i = 0; i < a.size(); ++i) longest2 = std::max(longest2, (a[i] - b[i]).squaredNorm());
  return std::sqrt(longest2);
}

// Steps that do not shrink go past their end, where a skin is about to buckle; and where one ring contact and
// several explain it alike, each step may choose the other. Then steps are halved, and stay with the
// contacts.
class StepDamping {
 public:
  StepDamping(double longest_mm, double least_mm)
      : most_mm_(longest_mm), least_mm_(least_mm), longest_mm_(longest_mm) {}

  /// A step, before it was shortened, and whether its loads include a ring contact.
  void Observe(double step_mm, bool has_ring) {
    changes_ += is_begun_ && has_ring != had_ring_ ? 1 : 0;
    longest_mm_ = is_begun_ && step_mm > before_mm_
                      ? std::clamp(std::min(step_mm, longest_mm_) / 2, least_mm_, most_mm_)
                      : std::min(2 * longest_mm_, most_mm_);
    before_mm_ = step_mm;
    had_ring_ = has_ring;
    is_begun_ = true;
  }
  double longest_mm() const { return longest_mm_; }
  bool may_be_ring() const { return changes_ < 2; }

 private:
  const double most_mm_, least_mm_;
  double longest_mm_, before_mm_ = 0;
  int changes_ = 0;
  bool is_begun_ = false, had_ring_ = false;
};

}  // namespace

SkinEstimator::SkinEstimator(const LinkModel& model, const SkinEstimatorOptions& options)
    : mechanics_(model, options.refinement),
      near_(Neighborhoods::SharedFor(mechanics_)),
      options_(options),
      assimilation_(mechanics_),
      gross_errors_(mechanics_),
      still_(std::make_unique<Tangent>(mechanics_, *near_, kStillReachMm)),
      touched_(std::make_unique<Tangent>(mechanics_, *near_, kTouchedReachMm)),
      used_(still_.get()),
      radial_pull_(mechanics_.marker_count()),
      radial_weight_(mechanics_.marker_count()) {}
SkinEstimator::~SkinEstimator() = default;

void SkinEstimator::Restart() {
  Forget();
  is_same_frame_ = false;
  still_->Forget();
  touched_->Forget();
}
void SkinEstimator::BeginAgain() {
  solved_.reset();
  past_ = past_before_;
  is_same_frame_ = true;
}
// After a frame without an answer the next one begins where this one did; after two of them, where an
// untouched skin does. What was on the way to an answer is another place to begin at. Where a frame begins is
// the nearest of them to its markers, so that one that nothing explains leaves nothing behind.
void SkinEstimator::KeepBefore(const ShellState* reached) {
  const bool is_first = past_before_.has_last && !past_before_.is_skipped;
  Forget();
  if (is_first) {
    past_ = past_before_;
    past_.is_skipped = true;
  }
  past_.has_reached = reached != nullptr;
  if (past_.has_reached) past_.reached = *reached;
}
void SkinEstimator::Forget() {
  past_.has_last = past_.has_reached = false;
  solved_.reset();
}
const Linearization& SkinEstimator::linearization() const {
  return used_->skin;
}
const LoadEstimator& SkinEstimator::loads() const {
  return used_->loads;
}

bool SkinEstimator::IsFirstOrder() const {
  return options_.model == ForceModel::kLinear || options_.model == ForceModel::kPressurised;
}

// The farthest that a seen marker has moved since the last call, mm.
double SkinEstimator::SeenMotion(const ShellState& state, const MarkerObservations& observed) {
  markers_before_mm_.swap(markers_mm_);
  mechanics_.markers().Displacements(state, markers_mm_);
  if (markers_before_mm_.size() != markers_mm_.size()) return kUnlimitedMm;
  double furthest = 0;
  for (size_t m = 0; m < observed.information.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    if (observed.information[m].trace() > 0)
      furthest = std::max(furthest, (markers_mm_ - markers_before_mm_).segment<3>(at).norm());
  }
  return furthest;
}

bool SkinEstimator::Remake(Tangent& tangent, const SkinProblem& problem, const ShellState& state,
                           const Eigen::VectorXd& local_n, SkinEstimate& estimate) {
  ++estimate.work.tangents;
  if (&tangent == still_.get()) return tangent.MakeUntouched(problem, state);
  return tangent.Make(problem, state, local_n, still_.get(), estimate.loads.loads.size());
}

SkinEstimator::StepLimits SkinEstimator::UsualLimits() const {
  return {.longest_mm = IsFirstOrder() ? kUnlimitedMm : kLongestStepMm * mechanics_.length_unit()};
}

bool SkinEstimator::StepOnce(Tangent& tangent, const SkinProblem& problem, const StepLimits& limits,
                             SkinEstimate& estimate, double& step_mm) {
  return tangent.skin.Rebase(estimate.state, problem.loads) &&
         Step(tangent, problem, limits, estimate, step_mm);
}

// From where the tangent was rebased last. `step_mm`: before it is shortened.
bool SkinEstimator::Step(Tangent& tangent, const SkinProblem& problem, const StepLimits& limits,
                         SkinEstimate& estimate, double& step_mm) {
  used_ = &tangent;
  ++estimate.work.steps;
  tangent.loads.Fit(tangent.skin, problem.observed,
                    &tangent == still_.get() ? nullptr : &still_->loads.FreeNorms(), limits.fit,
                    estimate.loads);
  estimate.work.trials += estimate.loads.trials;
  if (!estimate.loads.converged) return false;
  step_mm = tangent.skin.Step(estimate.loads.at_sites, estimate.loads.known_error, limits.longest_mm,
                              estimate.state);
  return std::isfinite(step_mm);
}

// About the skin without loads. True: that is all there is to do.
bool SkinEstimator::SolveSmall(Tangent& tangent, const SkinProblem& problem, SkinEstimate& estimate) {
  const bool linear = options_.model == ForceModel::kLinear;
  const ShellState about = linear ? mechanics_.shell().Rest() : problem.untouched.state;
  const double unit = mechanics_.length_unit();
  if (!tangent.IsGoodFor(problem, linear ? about : problem.untouched.about())) {
    SkinProblem mine = problem;
    if (linear) {
      mine.loads = {};
      mine.untouched.is_stiff_as_weightless = false;
    }
    if (!Remake(tangent, mine, about, {}, estimate)) return false;
  }
  estimate.state = about;
  double step_mm = 0;
  if (!StepOnce(tangent, problem, UsualLimits(), estimate, step_mm)) return false;
  estimate.model = linear ? ForceModel::kLinear : ForceModel::kPressurised;
  if (IsFirstOrder()) {
    estimate.first_order_mm = LongestOff(estimate.state.mids_mm, about.mids_mm);
    return true;
  }
  if (estimate.loads.loads.empty()) {
    // The nonlinear skin without loads is where the tangent is.
    estimate.model = options_.model.value_or(estimate.model);
    return true;
  }
  return options_.model != ForceModel::kNonlinear && step_mm < kStillReachMm * unit;
}

// Where much presses, by one fit about a state with the columns of the untouched skin; empty: nowhere.
Eigen::VectorXd SkinEstimator::FirstLocal(const SkinProblem& problem, SkinEstimate& estimate) {
  if (!still_->skin.Rebase(estimate.state, problem.loads)) return {};
  ++estimate.work.steps;
  still_->loads.Forget();
  still_->loads.Fit(still_->skin, problem.observed, nullptr, {.has_tangential = false}, estimate.loads);
  estimate.work.trials += estimate.loads.trials;
  if (!estimate.loads.converged || estimate.loads.loads.empty()) return {};
  return still_->loads.covariance().LocalOfSites(estimate.loads.contact_sizes_n);
}

bool SkinEstimator::SolveLarge(const SkinProblem& problem, SkinEstimate& estimate, Eigen::VectorXd local_n) {
  estimate.model = ForceModel::kNonlinear;
  const double unit = mechanics_.length_unit();
  if (local_n.size() > 0) {
    const Eigen::VectorXd first_n = FirstLocal(problem, estimate);
    if (first_n.size() > 0) local_n = first_n;
  }
  // A first guess: what the loads turn out to be decides whether all is made again.
  if (local_n.size() == 0) {
    if (estimate.loads.contact_sizes_n.size() > 0)
      local_n = touched_->loads.covariance().LocalOfSites(estimate.loads.contact_sizes_n);
    else if (touched_->local_n.size() > 0)
      local_n = touched_->local_n;
    else
      local_n = Eigen::VectorXd::Zero(mechanics_.site_count());
  }
  const bool is_remade = !touched_->IsGoodFor(problem, estimate.state);
  if (is_remade && !Remake(*touched_, problem, estimate.state, local_n, estimate)) return false;
  double before_mm = 1e9, step_mm = 0;
  bool is_seen_settled = false;
  StepDamping damping(UsualLimits().longest_mm, kLeastStepMm * unit);
  const int most_tangents = estimate.work.tangents + kMostTangents - (is_remade ? 1 : 0);
  for (int step = 0; step < kMostSteps; ++step) {
    if (IsSpent(estimate)) return false;
    const StepLimits limits{.longest_mm = damping.longest_mm(),
                            .fit = {.may_be_ring = damping.may_be_ring()}};
    if (!StepOnce(*touched_, problem, limits, estimate, step_mm)) return false;
    damping.Observe(step_mm, std::ranges::any_of(estimate.loads.loads, &EstimatedLoad::is_ring_contact));
    const Eigen::VectorXd local_before_n = local_n;
    local_n = touched_->loads.covariance().LocalOfSites(estimate.loads.contact_sizes_n);
    is_seen_settled = SeenMotion(estimate.state, problem.observed) < kSeenSettledMm * unit &&
                      (local_n - local_before_n).cwiseAbs().maxCoeff() < kSameLoads * local_n.maxCoeff();
    const double distance_mm = touched_->DistanceMm(estimate.state);
    const bool is_off = distance_mm > touched_->reach_mm || !touched_->HasLocal(local_n);
    const bool is_near_end = step_mm < kNearlySettledMm * unit;
    const bool is_slow = step > 0 && step_mm > (is_near_end ? kShrinksNearEnd : kShrinks) * before_mm;
    const bool is_settled =
        step_mm * std::min(1.0, kTangentErrorPerMm * distance_mm / unit) < kNextStepMm * unit;
    if (is_settled && !is_off) return true;
    before_mm = step_mm;
    const bool is_old = is_slow || (is_off && step_mm < kArrivingMm * unit);
    if (step + kStepsOfTangent < kMostSteps && is_old && estimate.work.tangents < most_tangents) {
      if (is_slow) touched_->is_prepared = false;
      const bool is_good = touched_->IsGoodFor(problem, estimate.state) && touched_->HasLocal(local_n);
      if (!is_good && !Remake(*touched_, problem, estimate.state, local_n, estimate)) return false;
      before_mm = 1e9;
    } else if (is_settled) {
      return true;
    }
  }
  is_settled_ = false;
  if (step_mm < kNearlySettledMm * unit) return true;
  // A skin that would buckle where a body hides it need not settle there.
  if (is_seen_settled) estimate.unsettled_mm = step_mm;
  return is_seen_settled;
}

// To first order, which serves as the skin was linearized near the specific force that fits best. The
// pressure stays as measured: drift and the comparison with rest images take up its error.
void SkinEstimator::AddWeightError(const UntouchedSkin& untouched, SkinEstimate& estimate) {
  const Vec3 error_mps2 = estimate.loads.known_error.tail<3>();
  if (error_mps2.isZero(0)) return;
  estimate.untouched_mm.noalias() += untouched.markers_by_loads.rightCols<3>() * error_mps2;
}

void SkinEstimator::Estimate(const SkinObservation& observation, SkinEstimate& estimate) {
  const bool is_new_frame = !std::exchange(is_same_frame_, false);
  if (is_new_frame && (past_.has_last || past_.has_reached))
    past_before_ = past_;
  else if (is_new_frame)
    past_before_.has_last = past_before_.has_reached = false;
  estimate.failure = EstimateFailure::kNoEquilibrium;
  if (is_new_frame) estimate.work = {};
  estimate.first_order_mm = estimate.unsettled_mm = 0;
  estimate.has_shape = false;
  const MeasuredLoads &now = observation.loads, &then = observation.baseline_loads;
  const UntouchedSkin* baseline = mechanics_.Untouched(then.Loads());
  if (baseline == nullptr) return;
  estimate.baseline_mm = baseline->markers_mm;
  KnownLoadsPrior prior;
  const double baseline_sigma_mpa = then.pressure_mpa != 0 ? then.pressure_sigma_mpa : 0;
  if (baseline_sigma_mpa > 0 || !then.specific_force_covariance.isZero(0)) {
    prior.baseline = ErrorsOf(baseline_sigma_mpa, then.specific_force_covariance);
    prior.baseline_mm = baseline->markers_by_loads * prior.baseline;
  }
  const double pressure_sigma_mpa =
      std::max(now.pressure_sigma_mpa, kLeastPressureSigma * mechanics_.pressure_step()) +
      kModelPressureShare * std::abs(now.pressure_mpa);
  prior.now = ErrorsOf(pressure_sigma_mpa, now.specific_force_covariance);
  const KnownLoads reference =
      FitKnownLoads(mechanics_, observation.markers, estimate.baseline_mm, now.Loads(), prior.now);
  const UntouchedSkin* untouched = mechanics_.Untouched(reference);
  if (untouched == nullptr) return;
  estimate.untouched_mm = untouched->markers_mm;
  const KnownLoads measured = untouched->loads;
  if (IsStill(observation, *untouched, measured, prior, estimate)) return;

  estimate.failure = EstimateFailure::kNotConverged;
  const bool may_stand = is_new_frame && IsStanding(observation, *untouched, prior);
  SkinProblem problem =
      MakeProblem(observation, *untouched, measured, std::move(prior), estimate.baseline_mm);
  const bool stands = may_stand && SolveStanding(problem, estimate);
  const bool is_solved = stands || SolveWithoutIsolated(problem, estimate);
  if (!is_solved) {
    KeepBefore(IsSpent(estimate) ? &estimate.state : nullptr);
    estimate.state = start_;
    mechanics_.markers().Displacements(start_, estimate.displacements_mm);
    estimate.has_shape = estimate.failure != EstimateFailure::kGrossErrors && IsPossible(estimate);
    return;
  }
  used_->loads.Conclude(used_->skin, estimate.loads);
  if (IsFirstOrder())
    used_->skin.FirstOrderMarkers(estimate.displacements_mm);
  else
    mechanics_.markers().Displacements(estimate.state, estimate.displacements_mm);
  estimate.displacements_mm += estimate.loads.beside_mm;
  estimate.known_loads = KnownLoads::FromStacked(problem.loads.Stacked() + estimate.loads.known_error);
  AddWeightError(problem.untouched, estimate);
  estimate.failure = !IsPossible(estimate)      ? EstimateFailure::kImpossible
                     : estimate.loads.converged ? EstimateFailure::kNone
                                                : EstimateFailure::kNotConverged;
  if (estimate.failure != EstimateFailure::kNone) return KeepBefore(nullptr);
  if (estimate.loads.loads.empty()) return Forget();
  past_.has_reached = false;
  past_.last = estimate.state;
  past_.has_last = true;
  past_.is_skipped = false;
  if (stands) return;
  solved_.reset();
  if (!is_settled_) return;
  solved_ = Solved{observation, problem.untouched.loads, estimate.model};
  solved_->observation.markers.information = problem.observed.information;
}

SkinProblem SkinEstimator::MakeProblem(const SkinObservation& observation, const UntouchedSkin& untouched,
                                       const KnownLoads& measured, KnownLoadsPrior prior,
                                       const Eigen::VectorXd& baseline_mm) const {
  SkinProblem problem{
      .observed = observation.markers, .untouched = untouched, .loads = measured, .prior = std::move(prior)};
  for (int m = 0; m < mechanics_.marker_count(); ++m)
    problem.observed.displacement_mm[static_cast<size_t>(m)] += baseline_mm.segment<3>(3 * m);
  return problem;
}

// What the touched skin's tangents take from the skin without loads. One from 2 mm of inflation away would do
// for the covariance, but not for the norms: weak loads were missed.
bool SkinEstimator::PrepareUntouched(const SkinProblem& problem, SkinEstimate& estimate) {
  const bool is_good = still_->is_prepared && still_->IsNear(problem.untouched.about()) &&
                       still_->loads.HasKnownLoads(problem.prior) &&
                       still_->loads.untouched()->IsGoodFor(problem.observed, problem.prior);
  if (!is_good && !Remake(*still_, problem, problem.untouched.state, {}, estimate)) return false;
  still_->loads.Hide(problem.observed);
  return true;
}

bool SkinEstimator::Solve(const SkinProblem& problem, SkinEstimate& estimate) {
  estimate.loads = {};
  estimate.failure = EstimateFailure::kNotConverged;
  estimate.unsettled_mm = 0;
  is_settled_ = true;
  start_ = problem.untouched.state;
  const bool is_small = IsFirstOrder() || FurthestOff(problem.untouched.state, problem.observed) <
                                              2 * kStillReachMm * mechanics_.length_unit();
  if (is_small && SolveSmall(*still_, problem, estimate)) return true;
  if (IsFirstOrder()) return false;
  const SkinEstimate small = estimate;
  if (!PrepareUntouched(problem, estimate)) return false;
  Eigen::VectorXd local_n;
  if (!Start(problem, estimate, local_n)) return false;
  // A small dent is nearer to where its first step has led.
  if (is_small && local_n.size() == 0 && !small.loads.loads.empty()) estimate.state = small.state;
  start_ = estimate.state;
  return SolveLarge(problem, estimate, local_n);
}

}  // namespace taclink

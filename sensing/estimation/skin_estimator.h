#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/known_loads.h"
#include "sensing/estimation/assimilation.h"
#include "sensing/estimation/frame_work.h"
#include "sensing/estimation/gross_error_test.h"
#include "sensing/estimation/load_estimator.h"
#include "sensing/estimation/skin_mechanics.h"
#include "sensing/estimation/tangent.h"

namespace taclink {

struct SkinObservation {
  /// Displacements count from the baseline.
  MarkerObservations markers;
  MeasuredLoads loads, baseline_loads;
};

/// Why an estimate is no answer.
enum class EstimateFailure : uint8_t {
  kNone,
  kNoEquilibrium,  ///< no stable skin under these known loads
  kNotConverged,   ///< no equilibrium that fits the markers was reached, or not by the work of a frame
  kGrossErrors,    ///< no loads move the markers so (GrossErrorTest)
  kImpossible,     ///< a marker beyond twice the radius, or a number that is none
};

/// Loads, known loads and shape of one moment: the shape is the equilibrium of all of them.
struct SkinEstimate {
  EstimateFailure failure = EstimateFailure::kNone;
  /// There is no answer, but a shape: where springs pull the skin's markers to what is seen. Without loads.
  bool has_shape = false;
  ForceModel model = ForceModel::kNonlinear;  ///< the approximation that was good enough
  ShellState state;
  /// Of the markers from the slack skin, stacked: where `state` has them and, where they disagree by more
  /// than noise, between that and what is seen (posterior of the model's error). What cameras that have moved
  /// make of them (loads.by_cameras_mm) is taken off.
  Eigen::VectorXd displacements_mm;
  Eigen::VectorXd baseline_mm;  ///< of the model's markers in the baseline, likewise
  /// Of the model's markers under the measured pressure and the estimated specific force, without contacts.
  Eigen::VectorXd untouched_mm;
  LoadEstimate loads;
  KnownLoads known_loads;  ///< with the estimated error taken off
  /// The longest way of a point of the skin from where the tangent of a first-order model that was asked for
  /// is made; else 0.
  double first_order_mm = 0;
  /// How far the last step still moved the skin somewhere that no camera sees, where loads and seen markers
  /// had settled; else 0.
  double unsettled_mm = 0;
  FrameWork work;
};

struct SkinEstimatorOptions {
  /// None: the cheapest whose error is small enough, frame by frame. kLiteral is no model of this estimator.
  std::optional<ForceModel> model = {};
  int refinement = 0;  ///< elements per interval of the marker grid; 0: as many as the skin's dents ask for
  /// A frame that has cost so many FrameWork::Units ends without an answer; the next one may begin where it
  /// has come to.
  int most_work = FrameWork::kUnlimited;
};

/// From labeled markers and known loads to loads, known loads and the nonlinear equilibrium shape together;
/// see estimation.md. The answer follows from the observation alone: the frames before only make it faster,
/// as a place to start from and as tangents that are still good. `linear` and `pressurised` are the same
/// problem with the tangent at the slack or the inflated skin and one step. One thread.
class SkinEstimator {
 public:
  explicit SkinEstimator(const LinkModel& model, const SkinEstimatorOptions& options = {});
  ~SkinEstimator();

  void Estimate(const SkinObservation& observation, SkinEstimate& estimate);
  /// Forgets the frames before: where the next one begins.
  void Forget();
  /// Instead of Estimate, of a frame that is no observation.
  void Skip() {
    past_before_ = past_;
    KeepBefore(nullptr);
  }
  /// And the tangents that were made in them.
  void Restart();
  /// The next call is of the same frame, looked at more closely: it begins from the last call's answer.
  void Continue() { is_same_frame_ = true; }
  /// The next call is of the same frame, without markers that were wrong: it begins from where the frame
  /// began, for a kink that a wrong marker has made may be an equilibrium without it.
  void BeginAgain();

  SkinMechanics& mechanics() { return mechanics_; }
  /// What the last estimate was made with.
  const Linearization& linearization() const;
  const LoadEstimator& loads() const;
  /// See LoadEstimator::Limits; after an estimate that is an answer.
  const DetectionLimits& Limits() { return still_->loads.Limits(); }

 private:
  /// In length units: from the inflated skin, whose tangent is good enough there; and of a step.
  static constexpr double kStillReachMm = 0.4, kLongestStepMm = 5;

  bool IsStill(const SkinObservation& observation, const UntouchedSkin& untouched, const KnownLoads& measured,
               const KnownLoadsPrior& prior, SkinEstimate& estimate);
  bool ExplainByKnownLoads(const MarkerObservations& observed, const UntouchedSkin& untouched,
                           const KnownLoads& measured, const KnownLoadsPrior& prior, SkinEstimate& estimate);
  static void AddWeightError(const UntouchedSkin& untouched, SkinEstimate& estimate);
  bool AddIfNoise(int marker, const Vec3& error, const Mat3& information);
  bool AreNeighborsStill() const;
  bool IsStanding(const SkinObservation& observation, const UntouchedSkin& untouched,
                  const KnownLoadsPrior& prior);
  bool SolveStanding(const SkinProblem& problem, SkinEstimate& estimate);
  double FurthestOff(const ShellState& state, const MarkerObservations& observed);
  double SeenMotion(const ShellState& state, const MarkerObservations& observed);
  bool Start(const SkinProblem& problem, SkinEstimate& estimate, Eigen::VectorXd& local_n);
  bool Remake(Tangent& tangent, const SkinProblem& problem, const ShellState& state,
              const Eigen::VectorXd& local_n, SkinEstimate& estimate);
  void KeepBefore(const ShellState* reached);
  bool IsSpent(const SkinEstimate& estimate) const { return estimate.work.Units() > options_.most_work; }
  struct StepLimits {
    double longest_mm = 0;  // a longer step is shortened to it
    FitOptions fit = {};
  };
  StepLimits UsualLimits() const;
  bool StepOnce(Tangent& tangent, const SkinProblem& problem, const StepLimits& limits,
                SkinEstimate& estimate, double& step_mm);
  bool Step(Tangent& tangent, const SkinProblem& problem, const StepLimits& limits, SkinEstimate& estimate,
            double& step_mm);
  bool SolveSmall(Tangent& tangent, const SkinProblem& problem, SkinEstimate& estimate);
  Eigen::VectorXd FirstLocal(const SkinProblem& problem, SkinEstimate& estimate);
  bool SolveLarge(const SkinProblem& problem, SkinEstimate& estimate, Eigen::VectorXd local_n);
  SkinProblem MakeProblem(const SkinObservation& observation, const UntouchedSkin& untouched,
                          const KnownLoads& measured, KnownLoadsPrior prior,
                          const Eigen::VectorXd& baseline_mm) const;
  bool PrepareUntouched(const SkinProblem& problem, SkinEstimate& estimate);
  bool Solve(const SkinProblem& problem, SkinEstimate& estimate);
  bool SolveWithoutIsolated(SkinProblem& problem, SkinEstimate& estimate);
  bool IsPossible(const SkinEstimate& estimate) const;
  /// One step from the slack or the inflated skin, whatever is asked of it.
  bool IsFirstOrder() const;

  SkinMechanics mechanics_;
  const std::shared_ptr<const Neighborhoods> near_;
  const SkinEstimatorOptions options_;
  Assimilation assimilation_;
  GrossErrorTest gross_errors_;
  std::unique_ptr<Tangent> still_, touched_;  // of the skin without loads, and of the touched one
  Tangent* used_ = nullptr;
  ShellState start_;  // that this frame's loads were sought from
  // Where a frame may begin: the state of the last frame with an answer, and where one without had come to.
  struct Past {
    bool has_last = false, has_reached = false;
    bool is_skipped = false;  // a frame without an answer lies between
    ShellState last, reached;
  };
  Past past_, past_before_;  // past_before_: when the frame began
  // The last frame whose contacts were looked for, to a settled end. None since Forget.
  struct Solved {
    SkinObservation observation;  // without the markers that were left out
    KnownLoads loads;             // of the untouched skin
    ForceModel model = ForceModel::kNonlinear;
  };
  std::optional<Solved> solved_;
  bool is_settled_ = false;  // of the last Solve
  bool is_same_frame_ = false;
  Eigen::VectorXd markers_mm_, markers_before_mm_;
  Eigen::VectorXd radial_pull_, radial_weight_;  // of the frame in work
  double noise_chi2_ = 0;                        // likewise
  int noise_markers_ = 0;
};

}  // namespace taclink

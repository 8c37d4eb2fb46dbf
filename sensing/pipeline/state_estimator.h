#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "sensing/camera/rest_shape.h"
#include "sensing/contact/contact_finder.h"
#include "sensing/core/contact.h"
#include "sensing/core/link_state.h"
#include "sensing/estimation/skin_estimator.h"
#include "sensing/estimation/thesis_force.h"
#include "sensing/pipeline/creep_history.h"
#include "sensing/pipeline/rest_loads.h"

namespace taclink {

struct ForceOptions {
  /// None: the cheapest whose estimated error is small enough, frame by frame.
  std::optional<ForceModel> model = {};
  /// Elements per interval of the marker grid; 0: as many as the skin's dents ask for.
  int refinement = 0;
  int most_work = FrameWork::kUnlimited;  ///< of a frame (SkinEstimatorOptions)
};

/// Known loads: of the moment, and under which the baseline was taken.
struct LoadsPair {
  MeasuredLoads now, baseline;
};

/// From measured markers and the pressure to all that a state tells of the skin: shape, pressure, forces,
/// contacts. Holds scratch memory: one thread.
class StateEstimator {
 public:
  StateEstimator(const LinkModel& model, const ForceOptions& options);

  /// Begins a frame of a link that is followed in time; call once, before Estimate. Converts the measured
  /// loads to those that Estimate takes (CreepHistory::Elastic). Without this call, forces are those of the
  /// elastic skin with E(0).
  MeasuredLoads BeginFrame(const MeasuredLoads& loads, const CreepHistory::Measured& measured,
                           int64_t exposure_ns) {
    return creep_.Elastic(loads, measured, exposure_ns);
  }
  /// Ends the frame: adds its estimate to the creep history. Not for an answer that is withheld.
  void EndFrame() { creep_.Advance(); }
  /// Uses `shape`'s measured displacements, from the baseline, and its sources; sets the rest of it, where it
  /// can. Where it can't, the forces are not converged, and the shape is what is measured: what was not stays
  /// at the untouched skin's, with a covariance that says so. A frame may be looked at several times
  /// (SkinEstimator::Continue, BeginAgain).
  void Estimate(const LoadsPair& loads, SkinShape& shape, NodalForces& forces);
  /// Instead of Estimate, where too little is seen: as where none can be made. Forgets the frames before.
  void GiveUp(const LoadsPair& loads, SkinShape& shape, NodalForces& forces);
  /// The contacts of what was estimated last, none where there is no answer. Once a frame, for `finder` gives
  /// them the ids of those of the call before.
  void FindContacts(ContactFinder& finder, const SkinShape& shape, const NodalForces& forces,
                    std::vector<Contact>& contacts);
  /// Writes the last estimate of the real known loads; nothing without an answer.
  void WriteKnownLoads(LinkState& state) const;
  /// How far what is not known of the specific force may put a marker off, one standard deviation, of the
  /// marker that it puts off most, mm; of the last estimate. 0: it is known, or there is no answer.
  double AttitudeErrorMm();
  /// Forgets the frames before, and the creep history.
  void Restart() {
    skin_.Restart();
    creep_.Forget();
  }
  /// Continues with the creep history of another estimator of the same model.
  void TakeHistory(const StateEstimator& other) { creep_ = other.creep_; }
  /// The creep history, for Restore.
  const CreepHistory& history() const { return creep_; }
  void Restore(const CreepHistory& history) { creep_ = history; }
  /// See CreepHistory::ForgetContacts.
  void ForgetContacts() { creep_.ForgetContacts(); }
  /// Dents of former contacts remain, which look like drift without the history.
  bool IsRecovering() const { return creep_.ResidualInward().size() > 0; }
  /// Displacements of the markers by these dents from the untouched skin under these loads, stacked, mm, to
  /// first order. Empty: negligible, or there is no such skin.
  Eigen::VectorXd ResidualMm(const KnownLoads& loads);

  /// Of the last call.
  const SkinEstimate& estimate() const { return estimate_; }
  SkinEstimator& skin() { return skin_; }
  /// What known loads alone do to the markers, from the slack skin; none: there is no such skin.
  std::optional<Eigen::VectorXd> UntouchedAt(const KnownLoads& loads);
  /// Likewise, of rest images; with the errors of the specific force, where it is not exact.
  std::optional<RestShape> RestShapeUnder(const MeasuredLoads& loads);
  /// For rest images; refers to this.
  RestSkin AtRest();
  /// The pressure that explains most markers, where nobody tells it: of each marker the one that its
  /// displacement along the inflation asks for, the median of them. Displacements from the baseline.
  MeasuredLoads PressureFromShape(const MarkerObservations& observed, const LoadsPair& loads);

 private:
  void MakeLoadsReal();
  void WriteShape(SkinShape& shape) const;
  void WriteForces(NodalForces& forces);
  void WriteLimits(NodalForces& forces);

  const LinkModel model_;
  const std::vector<Vec3> rest_mm_;
  const ForceOptions options_;
  SkinEstimator skin_;
  CreepHistory creep_;
  std::vector<size_t> marker_of_site_;  // the nearest
  std::unique_ptr<ThesisForce> thesis_;
  SkinObservation observation_;
  SkinEstimate estimate_;
};

/// Takes a moment: builds the shell's meshes.
std::unique_ptr<StateEstimator> MakeStateEstimator(const LinkModel& model, const ForceOptions& options);

}  // namespace taclink

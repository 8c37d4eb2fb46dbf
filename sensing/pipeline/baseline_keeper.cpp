#include "sensing/pipeline/baseline_keeper.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace taclink {
namespace {

// Further from the baseline's own known loads, the error of what they do would be taken for drift.
constexpr double kSamePressureMpa = 1e-4, kSameSpecificForceMps2 = 0.5;
// So long a tare waits where no loads explain the markers: by time, for such frames may take a second each.
constexpr int64_t kMostWaitedNs = 3'000'000'000;

double StrongestLoad(const LinkState& state) {
  double strongest = 0;
  for (const Contact& contact : state.contacts) strongest = std::max(strongest, contact.magnitude_n());
  for (const Vec3& force : state.forces.forces_n) strongest = std::max(strongest, force.norm());
  return strongest;
}

int64_t MonotonicNs(const FrameTimes& times, const Clock& clock) {
  return times.exposure_monotonic_ns != 0 ? times.exposure_monotonic_ns : clock.MonotonicNs();
}

std::vector<int> MissingFrom(const LabelledMarkers& markers, int count) {
  std::vector<int> missing;
  for (int m = 0; m < count; ++m) {
    const auto marker = static_cast<size_t>(m);
    if (std::ranges::none_of(markers.cameras, [marker](const std::vector<MarkerObservation>& camera) {
          return marker < camera.size() && camera[marker].seen;
        }))
      missing.push_back(m);
  }
  return missing;
}

}  // namespace

BaselineKeeper::BaselineKeeper(const LinkModel& model, const std::optional<DriftOptions>& drift)
    : model_(model), drift_(drift), follower_(model.markers.count(), drift.value_or(DriftOptions{})) {
  off_mm_.reserve(static_cast<size_t>(model.markers.count()));
}

void BaselineKeeper::Take(BaselineOrigin origin, const LabelledMarkers& markers, const KnownLoads& loads,
                          const FrameTimes& times, const Clock& clock,
                          std::optional<int64_t> calibrated_utc_ns) {
  const int64_t now_ns = times.exposure_utc_ns != 0 ? times.exposure_utc_ns : clock.UtcNs();
  baseline_ = {.origin = origin,
               .taken_utc_ns = now_ns,
               .calibrated_utc_ns = calibrated_utc_ns.value_or(now_ns),
               .missing_markers = MissingFrom(markers, model_.markers.count())};
  taken_ns_ = MonotonicNs(times, clock);
  loads_ = loads;
  follower_.Reset();
  replaced_.reset();
}

Result<void> BaselineKeeper::UndoTare(std::optional<SkinStage>& skin, StateEstimator& estimator) {
  if (tare_) return Error{ErrorCode::kFailedPrecondition, "a tare is under way; wait for its end"};
  if (!replaced_)
    return Error{ErrorCode::kFailedPrecondition,
                 "there is no tare to undo: none since the rest shape was taken, or it was undone already"};
  skin.emplace(replaced_->skin);
  baseline_ = replaced_->baseline;
  taken_ns_ = replaced_->taken_ns;
  loads_ = replaced_->loads;
  follower_ = replaced_->follower;
  if (replaced_->history) estimator.Restore(*replaced_->history);
  tare_end_ = TareSummary{.undone = true, .shift_mm = replaced_->shift_mm};
  replaced_.reset();
  return {};
}

Result<void> BaselineKeeper::BeginTare(const TareOptions& options) {
  if (tare_) return Error{ErrorCode::kFailedPrecondition, "a tare is under way; wait for its end"};
  tare_.emplace(model_, options);
  waits_since_ns_.reset();
  tare_end_.reset();
  return {};
}

void BaselineKeeper::CancelTare() {
  tare_.reset();
  tare_end_.reset();
}

void BaselineKeeper::AbortTare(const std::string& why) {
  if (tare_) tare_end_ = Error{ErrorCode::kFailedPrecondition, why};
  tare_.reset();
}

std::optional<Result<TareSummary>> BaselineKeeper::TakeTareEnd() {
  return std::exchange(tare_end_, std::nullopt);
}

void BaselineKeeper::Apply(const MeasuredLoads& loads, const SkinEstimate& estimate, const SkinShape& shape) {
  frame_loads_ = loads;
  off_mm_ = shape.displacements_mm;
  for (size_t m = 0; m < off_mm_.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    off_mm_[m] -= estimate.untouched_mm.segment<3>(at) - estimate.baseline_mm.segment<3>(at);
    // A baseline that is taken or follows takes up what the cameras did, too.
    if (estimate.loads.by_cameras_mm.size() > 0) off_mm_[m] += estimate.loads.by_cameras_mm.segment<3>(at);
    if (drift_) off_mm_[m] += follower_.drift_mm()[m];
  }
}

void BaselineKeeper::Learn(const FrameTimes& times, LinkState& state, const LabelledMarkers& labels,
                           SkinStage& skin, StateEstimator& estimator, const Clock& clock) {
  waits_since_ns_.reset();
  if (drift_) FollowDrift(times, state, estimator.IsRecovering(), clock);
  Tell(times, state, clock);
  if (tare_) TakeTareFrame(times, state, labels, skin, estimator, clock);
}

void BaselineKeeper::Wait(const FrameTimes& times, LinkState& state, const Clock& clock) {
  Tell(times, state, clock);
  if (!tare_) return;
  const int64_t now_ns = MonotonicNs(times, clock);
  if (!waits_since_ns_) waits_since_ns_ = now_ns;
  if (now_ns - *waits_since_ns_ > kMostWaitedNs)
    AbortTare("for 3 s there was no answer to tare by: " + state.status_reason +
              "; or take the rest shape again with nothing at the skin (calibrate)");
}

void BaselineKeeper::Tell(const FrameTimes& times, LinkState& state, const Clock& clock) const {
  state.baseline = baseline_;
  state.baseline.drift_mm = follower_.largest_mm();
  if (drift_) state.baseline.drift_state = follower_.following() ? DriftState::kFollowing : DriftState::kHeld;
  state.baseline_age_s = AgeS(times, clock);
}

// Not while a dent recovers: its recovery would be subtracted twice.
void BaselineKeeper::FollowDrift(const FrameTimes& times, const LinkState& state, bool is_recovering,
                                 const Clock& clock) {
  // Degraded by nothing but the drift itself.
  const bool good = state.status == LinkStatus::kOk || (state.measured() && state.reasons.size() == 1 &&
                                                        state.reasons[0].id == ReasonId::kDrift);
  const bool sure =
      good && !is_recovering &&
      std::abs(frame_loads_.pressure_mpa - loads_.pressure_mpa) <= kSamePressureMpa &&
      (frame_loads_.specific_force_mps2 - loads_.specific_force_mps2).norm() <= kSameSpecificForceMps2;
  follower_.Update(MonotonicNs(times, clock), sure ? std::optional(StrongestLoad(state)) : std::nullopt,
                   off_mm_);
}

void BaselineKeeper::TakeTareFrame(const FrameTimes& times, const LinkState& state,
                                   const LabelledMarkers& labels, SkinStage& skin, StateEstimator& estimator,
                                   const Clock& clock) {
  const Result<bool> complete = tare_->Add(state, labels, off_mm_, frame_loads_);
  if (complete && !*complete) return;
  if (!complete) {
    tare_end_ = complete.error();
  } else {
    tare_end_ = TareSummary{.frames = tare_->frames(),
                            .forced = tare_->forced(),
                            .shift_mm = tare_->shift_mm(),
                            .previous_age_s = AgeS(times, clock)};
    // The pressures were good enough for their frames' estimates.
    const MeasuredLoads loads = tare_->loads();
    const auto untouched = estimator.UntouchedAt(loads.Loads());
    Replaced before{skin, baseline_, taken_ns_, loads_, follower_, tare_->shift_mm(), {}};
    if (tare_->forced()) {
      before.history = estimator.history();
      estimator.ForgetContacts();
    }
    skin.Tare(tare_->markers(), loads, untouched.value_or(estimator.estimate().baseline_mm),
              estimator.ResidualMm(loads.Loads()));
    Take(tare_->forced() || is_forced() ? BaselineOrigin::kForcedTare : BaselineOrigin::kTare,
         tare_->markers(), loads.Loads(), times, clock, baseline_.calibrated_utc_ns);
    replaced_.emplace(std::move(before));
  }
  tare_.reset();
}

double BaselineKeeper::AgeS(const FrameTimes& times, const Clock& clock) const {
  return static_cast<double>(MonotonicNs(times, clock) - taken_ns_) * 1e-9;
}

std::optional<Reason> BaselineKeeper::DriftReason() const {
  const double drifted_mm = follower_.largest_mm();
  if (!drift_ || drifted_mm <= drift_->limit_mm) return {};
  char text[160];
  std::snprintf(
      text, sizeof text,
      "the baseline has drifted by %.2f mm since it was taken; tare the link while nothing touches it",
      drifted_mm);
  return Reason{ReasonId::kDrift, text, drifted_mm, drift_->limit_mm};
}

}  // namespace taclink

#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sensing/core/baseline.h"
#include "sensing/core/clock.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"
#include "sensing/pipeline/drift_follower.h"
#include "sensing/pipeline/skin_stage.h"
#include "sensing/pipeline/tare.h"

namespace taclink {

/// Knows what displacements are measured against: when and how it was taken, how far it has followed the skin
/// since, and a tare under way. Used frame by frame: Apply and Learn after the estimate, which takes DriftMm
/// off.
class BaselineKeeper {
 public:
  BaselineKeeper(const LinkModel& model, const std::optional<DriftOptions>& drift);

  /// A baseline was taken from these markers, under these loads, the newest of its frames at `times`. Times
  /// are those of frames, so that pictures solved again later tell the same; the clock's for frames without.
  /// `calibrated_utc_ns`: calibration time of its cameras, 0: unknown; none: calibrated from the same images.
  void Take(BaselineOrigin origin, const LabelledMarkers& markers, const KnownLoads& loads,
            const FrameTimes& times, const Clock& clock, std::optional<int64_t> calibrated_utc_ns);
  /// How far the untouched skin has gone since, by marker; empty: that is not followed.
  std::span<const Vec3> DriftMm() const { return drift_ ? follower_.drift_mm() : std::span<const Vec3>(); }

  /// Errors: kFailedPrecondition (one is under way).
  Result<void> BeginTare(const TareOptions& options);
  /// Restores the baseline before the last tare; TakeTareEnd returns the result. Errors: kFailedPrecondition
  /// (a tare is under way, or there was none since the rest shape was taken).
  Result<void> UndoTare(std::optional<SkinStage>& skin, StateEstimator& estimator);
  void CancelTare();
  /// Its end will say why.
  void AbortTare(const std::string& why);
  std::optional<Result<TareSummary>> TakeTareEnd();

  /// A frame's shape, of which what the pressure alone has changed since the baseline is left out.
  void Apply(const MeasuredLoads& loads, const SkinEstimate& estimate, const SkinShape& shape);
  /// Instead of Apply and Learn: there is a shape, but no answer to what moved it. Tells; a tare waits for an
  /// answer, and ends without one after a while.
  void Wait(const FrameTimes& times, LinkState& state, const Clock& clock);
  /// Fills what the state says of the baseline.
  void Tell(const FrameTimes& times, LinkState& state, const Clock& clock) const;
  /// Follows drift and takes a tare's frame, which may be its last; then tells.
  void Learn(const FrameTimes& times, LinkState& state, const LabelledMarkers& labels, SkinStage& skin,
             StateEstimator& estimator, const Clock& clock);

  /// None: it has not drifted far.
  std::optional<Reason> DriftReason() const;
  /// What touched when a tare was forced is part of the baseline until rest is taken again: a tare that is
  /// not forced cannot see whether it has gone.
  bool is_forced() const { return baseline_.origin == BaselineOrigin::kForcedTare; }

 private:
  void FollowDrift(const FrameTimes& times, const LinkState& state, bool is_recovering, const Clock& clock);
  void TakeTareFrame(const FrameTimes& times, const LinkState& state, const LabelledMarkers& labels,
                     SkinStage& skin, StateEstimator& estimator, const Clock& clock);
  double AgeS(const FrameTimes& times, const Clock& clock) const;

  /// What a tare replaced.
  struct Replaced {
    SkinStage skin;
    Baseline baseline;
    int64_t taken_ns;
    KnownLoads loads;
    DriftFollower follower;
    double shift_mm;                      // of the tare
    std::optional<CreepHistory> history;  // before a forced tare, which discards the contacts
  };

  const LinkModel model_;
  const std::optional<DriftOptions> drift_;
  Baseline baseline_;
  int64_t taken_ns_ = 0;  // monotonic
  KnownLoads loads_;
  DriftFollower follower_;

  MeasuredLoads frame_loads_;  // of the frame in work
  std::vector<Vec3> off_mm_;   // likewise: against the baseline as it was taken, without pressure's part

  std::optional<TareCollector> tare_;
  std::optional<Replaced> replaced_;
  std::optional<int64_t> waits_since_ns_;  // for an answer; monotonic
  std::optional<Result<TareSummary>> tare_end_;
};

}  // namespace taclink

#pragma once

#include <memory>
#include <optional>

#include "sensing/camera/calibration.h"
#include "sensing/contact/contact_finder.h"
#include "sensing/core/baseline.h"
#include "sensing/core/clock.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"
#include "sensing/markers/track/marker_tracker.h"
#include "sensing/pipeline/drift_options.h"
#include "sensing/pipeline/state_estimator.h"

namespace taclink {

struct PipelineOptions {
  /// Camera parameters of this very link; none: found from the rest pictures.
  std::optional<StereoRig> rig;
  /// Calibration time of `rig`, since 1970-01-01; 0: unknown.
  int64_t calibrated_utc_s = 0;
  /// Gauge pressure where the source does not measure it. None: nobody tells it, and forces are degraded.
  std::optional<double> pressure_mpa;
  /// Standard deviation of the pressure, whoever tells it; none: as is usual for its source (PressureSigma).
  std::optional<double> pressure_sigma_mpa;
  /// The baseline is the mean of so many rest pairs. They must be untouched.
  int rest_frames = 8;
  /// Files and simulations may show the same picture twice; of a camera it means that it hangs.
  bool pictures_may_repeat = false;
  /// Search the full pictures in every frame instead of following the markers.
  bool always_acquire = false;
  MarkerTrackerOptions tracking;
  ForceOptions force;
  ContactOptions contact;
  /// How the baseline follows a skin that creeps; none: it stays as it was taken.
  std::optional<DriftOptions> drift;
};

/// Standard deviation of a gauge pressure by who tells it: a sensor's gauge is off by some 50 Pa, what a
/// configuration says may be off by more, and a simulation knows.
double PressureSigma(PressureOrigin origin);

/// How the taking of rest pairs goes.
struct RestProgress {
  int taken = 0, wanted = 0;
  std::optional<Error> refusal;  ///< of the newest pair: collecting has started again
  /// Why the newest frame cannot be a rest pair (a camera is lost, the pressure is stale or changes); empty:
  /// it is one.
  std::string waiting_for = {};
};

/// The whole way from two pictures to contacts, for one link: the list of its stages is `Process`. One
/// thread.
class LinkPipeline {
 public:
  LinkPipeline(const LinkModel& model, const PipelineOptions& options, Clock& clock = SystemClock());
  ~LinkPipeline();
  LinkPipeline(LinkPipeline&&) noexcept;

  /// Takes one pair through all stages. Until there is a baseline, pairs are taken as rest pictures (status
  /// kCalibrating, with the reason while they don't serve; after a refusal not every pair is tried, but one
  /// every 0.6 s of exposure time at least). `state`'s buffers are reused. Never fails: what
  /// is wrong is in the state's status and reason.
  void Process(const StereoFrame& frame, LinkState& state);

  /// Forgets the rest shape and all that followed: the next pairs are taken as rest pictures, as after
  /// construction.
  void Restart();

  /// Takes the next pairs as rest pictures: finds the cameras and the baseline again. Until they are complete
  /// nothing is measured (status kCalibrating).
  void BeginRest(int pairs);
  /// Gives that up, if it was not complete: measures on with the baseline of before. Without one, rest pairs
  /// are taken with the configured cameras, as after construction.
  void CancelRest();
  const RestProgress& rest_progress() const;

  /// Makes the mean of the next frames the baseline, the cameras stay. Meanwhile all goes on as before. Or
  /// undoes the last tare (TareOptions::undo). Errors: kFailedPrecondition (no baseline yet, rest pairs
  /// are being taken, or there is no tare to undo).
  Result<void> BeginTare(const TareOptions& options);
  void CancelTare();
  /// After each Process, once: how the tare ended. Errors: as TareCollector::Add; then the old baseline
  /// stays.
  std::optional<Result<TareSummary>> TakeTareEnd();

  /// Computes the forces so from the next frame on; baseline and contacts stay. Not null, and made for the
  /// same model.
  void UseEstimator(std::shared_ptr<StateEstimator> estimator);

  const LinkModel& model() const;
  /// Of the last pair that was measured: which detection is which marker.
  const LabelledMarkers& labels() const;
  /// Set once the cameras are known.
  const std::optional<CalibrationSummary>& calibration() const;

 private:
  struct Stages;
  std::unique_ptr<Stages> stages_;
};

}  // namespace taclink

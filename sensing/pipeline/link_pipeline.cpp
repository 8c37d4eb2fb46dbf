#include "sensing/pipeline/link_pipeline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/core.hpp>
#include <string>

#include "sensing/markers/detect/detector.h"
#include "sensing/markers/label/path_tracker.h"
#include "sensing/markers/track/marker_tracker.h"
#include "sensing/pipeline/attitude_check.h"
#include "sensing/pipeline/baseline_keeper.h"
#include "sensing/pipeline/camera_diagnosis.h"
#include "sensing/pipeline/camera_motion.h"
#include "sensing/pipeline/image_contrast.h"
#include "sensing/pipeline/judge.h"
#include "sensing/pipeline/mean_loads.h"
#include "sensing/pipeline/picture_stage.h"
#include "sensing/pipeline/rest_pose.h"
#include "sensing/pipeline/skin_stage.h"

namespace taclink {
namespace {

// Markers are followed across a gap of so many frames.
constexpr uint64_t kMaxStep = 3;
// Between a refused rest pair and the next that is tried, of exposure time: labelling what is no rest picture
// takes far longer than a frame. Begins with the first and doubles; with the second a link still begins
// within a second once its pictures serve.
constexpr int64_t kFirstWaitNs = 66'000'000, kLongestWaitNs = 600'000'000;

void SetStatus(LinkState& state, LinkStatus status, std::string reason) {
  state.status = status;
  state.status_reason = std::move(reason);
  state.reasons.clear();
}

// Cameras are told from a skin whose shape is known.
std::string CalibrationAdvice(const MeasuredLoads& loads) {
  if (std::abs(loads.pressure_mpa) <= 3 * loads.pressure_sigma_mpa) return {};
  char text[160];
  std::snprintf(
      text, sizeof text,
      "; the skin is under %.3f kPa: cameras are calibrated without pressure, or have a saved calibration",
      1e3 * loads.pressure_mpa);
  return text;
}

// A baseline that is taken in this frame has the specific force that was estimated in it.
MeasuredLoads WithEstimate(MeasuredLoads loads, const LinkState& state) {
  if (const auto& estimate = state.specific_force_estimate) {
    loads.specific_force_mps2 = estimate->mps2 + loads.by_creep.tail<3>();
    loads.specific_force_covariance = estimate->covariance;
  }
  return loads;
}

}  // namespace

struct LinkPipeline::Stages {
  Stages(const LinkModel& link_model, const PipelineOptions& pipeline_options, Clock& pipeline_clock)
      : model(link_model),
        options(pipeline_options),
        clock(pipeline_clock),
        estimator(MakeStateEstimator(link_model, pipeline_options.force)),
        finder(link_model, pipeline_options.contact),
        keeper(link_model, pipeline_options.drift),
        diagnosis(link_model) {
    BeginRest(options.rig, options.rest_frames, BaselineOrigin::kStart);
  }

  const LinkModel model;
  const PipelineOptions options;
  Clock& clock;

  PictureStage camera_pictures;
  std::array<ImageContrast, kCameraCount> contrasts;
  MarkerDetector detector;
  std::array<Detections, kCameraCount> detections;
  std::optional<RestPose> rest;  // while rest pairs are taken
  MeanLoads rest_loads;          // of these
  RestProgress rest_progress;
  std::string last_refusal;                            // of these pairs, while more are taken
  bool calibrates = false;                             // the cameras are told from them
  BaselineOrigin rest_origin = BaselineOrigin::kNone;  // of what is being taken
  size_t refusals = 0;                                 // of these pairs
  int64_t refused_ns = 0, wait_ns = 0;  // exposure of the pair last refused; until the next is tried
  // Made when the rest pose is known.
  std::optional<CalibrationSummary> calibration;
  std::optional<PathTracker> acquirer;
  std::optional<MarkerTracker> tracker;
  std::optional<SkinStage> skin;
  std::optional<CameraMotion> motion;

  MarkerTracker::Pictures pictures;              // of the frame in work; empty where there is none
  AcquireReason reason = AcquireReason::kFirst;  // of the frame in work
  uint64_t sequence = 0;                         // of the frame before
  LabelledMarkers acquired, labels;
  std::vector<Vec3> untouched_mm;  // of the last frame that had an estimate
  std::vector<Vec3> predicted_mm;  // the shape of the last frame that had one
  std::shared_ptr<StateEstimator> estimator;
  ContactFinder finder;
  BaselineKeeper keeper;
  CameraDiagnosis diagnosis;
  AttitudeCheck attitude;

  double MsSince(int64_t start_ns) const {
    return static_cast<double>(clock.MonotonicNs() - start_ns) * 1e-6;
  }

  const StereoRig& CurrentRig() const {
    if (calibration) return calibration->rig;
    return options.rig ? *options.rig : model.nominal_rig;
  }

  void Detect(LinkState& state) {
    for (size_t i = 0; i < kCameraCount; ++i) {
      detections[i].clear();
      if (camera_pictures.has(i)) detector.Detect(camera_pictures.gray(i), detections[i]);
      state.cameras[i].detections = static_cast<int>(detections[i].size());
      state.tracking.cameras[i].share_read = camera_pictures.has(i) ? 1 : 0;
    }
  }

  // Before the first look at a frame; a loss shows later.
  AcquireReason ReasonToAcquire(uint64_t next) const {
    if (!tracker || rest) return AcquireReason::kFirst;
    if (options.always_acquire) return AcquireReason::kForced;
    if (next < sequence || next > sequence + kMaxStep) return AcquireReason::kGap;
    return tracker->WantsAcquire();
  }

  // Follows the markers in their windows, or finds the spots of the full pictures.
  void Find(uint64_t next, LinkState& state) {
    state.tracking = {};
    reason = ReasonToAcquire(next);
    sequence = next;
    for (size_t i = 0; i < kCameraCount; ++i)
      pictures[i] = camera_pictures.has(i) ? camera_pictures.gray(i) : cv::Mat();
    if (reason == AcquireReason::kNone) return tracker->Follow(pictures, predicted_mm, state.tracking);
    if (tracker) tracker->Forget();
    Detect(state);
  }

  // As the last estimate had them.
  std::span<const Vec3> UntouchedMarkers() {
    if (untouched_mm.empty()) untouched_mm = model.RestMarkers();
    return untouched_mm;
  }

  // The tracker's displacements are those that contacts cause.
  void FollowUntouched(const SkinEstimate& estimate) {
    const auto count = static_cast<size_t>(model.markers.count());
    if (estimate.failure != EstimateFailure::kNone ||
        estimate.untouched_mm.size() != 3 * static_cast<Eigen::Index>(count))
      return;
    untouched_mm.resize(count);
    for (size_t m = 0; m < count; ++m)
      untouched_mm[m] = model.RestMarker(static_cast<int>(m)) +
                        estimate.untouched_mm.segment<3>(3 * static_cast<Eigen::Index>(m));
    tracker->SetUntouched(untouched_mm);
  }

  void BeginRest(const std::optional<StereoRig>& rig, int pairs, BaselineOrigin origin) {
    keeper.AbortTare("the rest shape is being taken again");
    rest_origin = origin;
    rest.emplace(model, rig, pairs);
    rest_loads.Clear();
    rest_progress = {.taken = 0, .wanted = pairs, .refusal = {}, .waiting_for = {}};
    last_refusal.clear();
    calibrates = !rig;
    refusals = 0;
    wait_ns = 0;
  }

  // Too soon after a pair that was refused. A frame without a time is always tried.
  bool WaitsForRest(const FrameTimes& times) const {
    const int64_t now_ns = times.exposure_monotonic_ns;
    return rest && rest_progress.refusal && now_ns > refused_ns && now_ns < refused_ns + wait_ns;
  }

  // Nothing stays of what was measured into the same buffers before.
  static void Forget(LinkState& state) {
    state.ClearMeasurement();
    state.baseline = {};
    state.baseline_age_s = 0;
    for (CameraCounts& camera : state.cameras) {
      camera.labelled = 0;
      camera.contrast.reset();
    }
  }

  void SkipRest(LinkState& state) {
    Forget(state);
    state.tracking = {};
    for (size_t i = 0; i < kCameraCount; ++i)
      state.cameras[i].detections = static_cast<int>(detections[i].size());
    SetStatus(state, LinkStatus::kCalibrating,
              camera_pictures.trouble() ? camera_pictures.trouble()->text : last_refusal);
  }

  // No baseline while the pressure is unknown: the error would persist until the next tare.
  void WaitForPressure(LinkState& state) {
    Forget(state);
    PostponeRest("the rest shape waits for the pressure sensor: " + state.pressure.trouble, state);
  }

  void PostponeRest(std::string why, LinkState& state) {
    rest_progress.waiting_for = why;
    SetStatus(state, LinkStatus::kCalibrating, std::move(why));
  }

  // A pair before the baseline is known.
  void TakeRest(const StereoFrame& frame, const MeasuredLoads& loads, LinkState& state) {
    Forget(state);
    if (const auto& trouble = camera_pictures.trouble()) return PostponeRest(trouble->text, state);
    rest_loads.Add(loads);
    if (std::string trouble = rest_loads.Trouble(); !trouble.empty()) {
      rest->StartAgain();
      rest_loads.Clear();
      rest_progress.taken = 0;
      return PostponeRest(std::move(trouble), state);
    }
    rest_progress.waiting_for.clear();
    const auto complete = rest->Add(
        detections, pictures, RestAlternatives(rest_loads.mean(), NeverMoves(frame)), estimator->AtRest());
    rest_progress.taken = rest->taken();
    rest_progress.refusal = complete ? std::nullopt : std::optional(complete.error());
    if (!complete) {
      if (calibrates) rest_progress.refusal->message += CalibrationAdvice(loads.Real());
      last_refusal = rest_progress.refusal->message;
      rest_loads.Clear();
      ++refusals;
      const bool begins_again = rest->taken() > 0;
      if (begins_again) rest_loads.Add(loads);
      refused_ns = frame.times.exposure_monotonic_ns;
      wait_ns = begins_again ? 0 : std::clamp(2 * wait_ns, kFirstWaitNs, kLongestWaitNs);
      return SetStatus(state, LinkStatus::kCalibrating, last_refusal);
    }
    std::string taking = "taking the rest shape; do not touch the skin";
    if (!last_refusal.empty()) taking = "taking the rest shape again. Before: " + last_refusal;
    SetStatus(state, LinkStatus::kCalibrating, std::move(taking));
    if (!*complete) return;
    BeginMeasurement(*rest->result(), frame);
    rest.reset();
  }

  // Images that the measured loads do not explain may show another attitude: of a link that never moves
  // nobody need tell it, and a wrong one is found here (attitude_mismatch). With each refusal another guess
  // is tried, for all of them would keep the link busy for 10 s.
  std::vector<MeasuredLoads> RestAlternatives(const MeasuredLoads& measured, bool never_moves) const {
    MeasuredLoads any = measured;
    any.ForgetAttitude();
    const std::vector<MeasuredLoads> guesses = RestGuesses(any);
    if (refusals == 0 && !never_moves) return {measured};
    if (!calibrates) return {measured, any};  // labels of known cameras need no guess
    return {measured, guesses[refusals % guesses.size()]};
  }

  void BeginMeasurement(const RestResult& found, const StereoFrame& frame) {
    calibration = found.calibration;
    acquirer.emplace(model, calibration->rig);
    tracker.emplace(model, calibration->rig, options.tracking);
    motion.emplace(model, calibration->rig, found.noise_px);
    CameraEvidenceOptions cameras;
    cameras.camera_sigma_px = std::max(cameras.camera_sigma_px, found.noise_px);
    cameras.rest_sigma_px = found.noise_px / std::sqrt(std::max(1, rest_progress.wanted));
    skin.emplace(model, *calibration, cameras, found.noise_px);
    MeasuredLoads loads = found.loads;
    // Whatever it is, it stays, and is no difference to any frame.
    if (NeverMoves(frame)) loads.specific_force_covariance.setZero();
    skin->SetBaseline(found.markers, loads, *estimator->UntouchedAt(loads.Loads()),
                      estimator->ResidualMm(loads.Loads()));
    for (size_t i = 0; i < kCameraCount; ++i) contrasts[i].SetRest(pictures[i], found.markers.cameras[i]);
    keeper.Take(rest_origin, found.markers, loads.Loads(), frame.times, clock, CalibratedUtcNs());
    attitude.Restart();
    diagnosis.Begin(estimator->skin().mechanics(), loads, calibration->rig, found.markers,
                    found.moved_cameras);
    predicted_mm.clear();
  }

  // Calibration time of the cameras in use; none: calibrated from the rest images.
  std::optional<int64_t> CalibratedUtcNs() const {
    if (rest_origin != BaselineOrigin::kStart || !options.rig) return std::nullopt;
    return options.calibrated_utc_s * 1'000'000'000;
  }

  bool IsPressureTold(const StereoFrame& frame) const {
    return !frame.pressure.stale &&
           (frame.pressure_mpa || options.pressure_mpa || frame.pressure.origin != PressureOrigin::kNone);
  }
  // Nobody tells the specific force: the link keeps the attitude in which its rest images were taken.
  static bool NeverMoves(const StereoFrame& frame) { return !frame.specific_force; }

  // Call once a frame: advances the creep history.
  MeasuredLoads TakeLoads(const StereoFrame& frame) {
    MeasuredLoads measured{
        .pressure_mpa = frame.pressure.stale ? frame.pressure.mpa
                                             : frame.pressure_mpa.value_or(options.pressure_mpa.value_or(0)),
        .pressure_sigma_mpa = options.pressure_sigma_mpa.value_or(PressureSigma(frame.pressure.origin))};
    if (frame.specific_force) {
      measured.specific_force_mps2 = frame.specific_force->mps2;
      measured.specific_force_covariance = frame.specific_force->covariance;
    } else if (skin && !rest) {
      measured.specific_force_mps2 = skin->baseline_loads().specific_force_mps2;
    }
    const int64_t exposure_ns = frame.times.exposure_monotonic_ns;
    return estimator->BeginFrame(
        measured,
        {.pressure = IsPressureTold(frame),
         .specific_force = frame.specific_force.has_value() && !IsAttitudeUnknown(measured)},
        exposure_ns != 0 ? exposure_ns : clock.MonotonicNs());
  }

  // Labels that contradict the shape are no labels.
  void TakeBackRejected(LinkState& state) {
    for (const RejectedMarker& rejected : state.shape.rejected) {
      const auto i = Index(rejected.camera);
      labels.cameras[i][static_cast<size_t>(rejected.marker)].seen = false;
      tracker->Reject(rejected.camera, rejected.marker);
      ++state.tracking.cameras[i].dropped;
      --state.cameras[i].labelled;
    }
  }

  // Checks the labels of the markers followed; where that fails, finds them again, in the same frame.
  void Label(LinkState& state) {
    TrackingReport& report = state.tracking;
    report.mode = TrackingMode::kTracked;
    if (reason == AcquireReason::kNone) {
      tracker->Check(labels, report);
      reason = tracker->WantsAcquire();
      if (reason != AcquireReason::kNone) Detect(state);
    }
    if (reason != AcquireReason::kNone) {
      report.mode = TrackingMode::kAcquired;
      report.reason = reason;
      acquirer->Label(detections, acquired);
      tracker->Adopt(pictures, acquired, labels, report);
    }
    for (const CameraId id : kBothCameras) {
      CameraCounts& counts = state.cameras[Index(id)];
      counts.labelled = tracker->seen(id);
      if (reason == AcquireReason::kNone) counts.detections = counts.labelled;
      counts.contrast = contrasts[Index(id)].Of(pictures[Index(id)], labels.cameras[Index(id)]);
    }
  }
};

double PressureSigma(PressureOrigin origin) {
  switch (origin) {
    case PressureOrigin::kSimulated:
      return 2e-5;
    case PressureOrigin::kFile:
    case PressureOrigin::kSerial:
    case PressureOrigin::kClient:
    case PressureOrigin::kRegulator:
      return 5e-5;
    case PressureOrigin::kNone:
    case PressureOrigin::kConstant:
      break;
  }
  return 1e-4;
}

LinkPipeline::LinkPipeline(const LinkModel& model, const PipelineOptions& options, Clock& clock)
    : stages_(std::make_unique<Stages>(model, options, clock)) {}
LinkPipeline::~LinkPipeline() = default;
LinkPipeline::LinkPipeline(LinkPipeline&&) noexcept = default;

void LinkPipeline::Restart() {
  stages_->BeginRest(stages_->options.rig, stages_->options.rest_frames, BaselineOrigin::kStart);
  stages_->calibration.reset();
  stages_->acquirer.reset();
  stages_->tracker.reset();
  stages_->motion.reset();
  stages_->predicted_mm.clear();
  stages_->skin.reset();
  stages_->estimator->Restart();
  stages_->finder = ContactFinder(stages_->model, stages_->options.contact);
}

void LinkPipeline::UseEstimator(std::shared_ptr<StateEstimator> estimator) {
  estimator->TakeHistory(*stages_->estimator);
  stages_->estimator = std::move(estimator);
}

const LinkModel& LinkPipeline::model() const {
  return stages_->model;
}
const LabelledMarkers& LinkPipeline::labels() const {
  return stages_->labels;
}
const std::optional<CalibrationSummary>& LinkPipeline::calibration() const {
  return stages_->calibration;
}

void LinkPipeline::BeginRest(int pairs) {
  stages_->BeginRest(std::nullopt, pairs, BaselineOrigin::kCalibration);
}
void LinkPipeline::CancelRest() {
  if (!stages_->rest) return;
  if (stages_->skin)
    stages_->rest.reset();
  else
    stages_->BeginRest(stages_->options.rig, stages_->options.rest_frames, BaselineOrigin::kStart);
}
const RestProgress& LinkPipeline::rest_progress() const {
  return stages_->rest_progress;
}

Result<void> LinkPipeline::BeginTare(const TareOptions& options) {
  if (stages_->rest || !stages_->skin)
    return Error{ErrorCode::kFailedPrecondition,
                 "the link's rest shape is being taken; wait until it measures"};
  if (options.undo) return stages_->keeper.UndoTare(stages_->skin, *stages_->estimator);
  return stages_->keeper.BeginTare(options);
}
void LinkPipeline::CancelTare() {
  stages_->keeper.CancelTare();
}
std::optional<Result<TareSummary>> LinkPipeline::TakeTareEnd() {
  return stages_->keeper.TakeTareEnd();
}

void LinkPipeline::Process(const StereoFrame& frame, LinkState& state) {
  Stages& s = *stages_;
  state.sequence = frame.sequence;
  state.times = frame.times;
  state.pressure_mpa = frame.pressure_mpa;
  state.pressure = frame.pressure;
  state.specific_force = frame.specific_force;
  state.simulation = frame.simulation;
  state.stage_ms = {};
  const bool stale = frame.pressure.stale;
  const MeasuredLoads measured = s.TakeLoads(frame);
  // Without a sensor, or when it fell silent, the pressure is estimated from the shape.
  const bool is_pressure_measured = s.IsPressureTold(frame);

  const auto timed = [&s](double& stage_ms, auto&& stage) {
    const int64_t start = s.clock.MonotonicNs();
    stage();
    stage_ms = s.MsSince(start);
  };
  timed(state.stage_ms.decode, [&] {
    const ImageRepeats repeats = s.options.pictures_may_repeat ? ImageRepeats::kAllowed
                                 : s.rest                      ? ImageRepeats::kAtRest
                                                               : ImageRepeats::kFault;
    s.camera_pictures.Take(frame, s.CurrentRig(), repeats, s.rest.has_value(), state);
  });
  if (s.WaitsForRest(frame.times)) return s.SkipRest(state);
  timed(state.stage_ms.detect, [&] { s.Find(frame.sequence, state); });
  if (s.rest) {
    if (stale) return s.WaitForPressure(state);
    s.TakeRest(frame, measured, state);
    return;
  }
  MeasuredLoads loads = s.attitude.LoadsOf(measured, frame.times.exposure_monotonic_ns);
  const std::optional<MeasuredLoads> known = is_pressure_measured ? std::optional(loads) : std::nullopt;
  timed(state.stage_ms.register_, [&] { s.Label(state); });
  s.motion->Observe(frame.times, s.labels);
  state.times.tracked_ns = s.clock.MonotonicNs();
  timed(state.stage_ms.force,
        [&] { s.skin->Run(s.labels, known, s.keeper.DriftMm(), *s.estimator, s.finder, state, loads); });
  s.TakeBackRejected(state);
  s.predicted_mm = state.shape.positions_mm;
  const SkinEstimate& estimate = s.estimator->estimate();
  s.FollowUntouched(estimate);
  s.attitude.Observe(measured, s.skin->baseline_loads(), estimate);
  s.estimator->WriteKnownLoads(state);
  if (estimate.failure == EstimateFailure::kNone)
    s.keeper.Apply(WithEstimate(loads, state), estimate, state.shape);
  state.total_force_n.setZero();
  for (const Contact& contact : state.contacts) state.total_force_n += contact.force_n;
  const auto obstruction = FindViewObstruction(s.model, s.skin->residuals());
  Judge({.model = s.model,
         .camera_trouble = s.camera_pictures.trouble(),
         .camera_warning = s.camera_pictures.warning(),
         .agreement = s.skin->agreement(),
         .diagnosis = s.diagnosis.reason(),
         .motion = s.motion->disagreement(),
         .sees_alone = s.skin->sees_alone(),
         .obstruction = obstruction,
         .attitude = s.attitude.disagreement(),
         .attitude_error_mm = s.estimator->AttitudeErrorMm(),
         .drift = s.keeper.DriftReason(),
         .is_baseline_forced = s.keeper.is_forced(),
         .measured = loads.Real(),
         .is_pressure_measured = is_pressure_measured,
         .baseline = s.skin->baseline_loads().Real(),
         .estimate = estimate},
        state);
  if (state.has_forces()) s.estimator->EndFrame();
  s.diagnosis.Observe(state, {.images = s.pictures,
                              .skin_mm = s.UntouchedMarkers(),
                              .estimate = estimate,
                              .residuals = s.skin->residuals(),
                              .obstruction = obstruction});
  // A tare ends where nothing is measured; where there is a shape without forces it waits for a while.
  if (estimate.failure == EstimateFailure::kNone || !state.measured())
    s.keeper.Learn(frame.times, state, s.labels, *s.skin, *s.estimator, s.clock);
  else
    s.keeper.Wait(frame.times, state, s.clock);
  state.times.solved_ns = s.clock.MonotonicNs();
}

}  // namespace taclink

#include "server/assembly/pipeline_processor.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "sensing/camera/calibration_parameters.h"
#include "sensing/camera/camera_shift.h"
#include "sensing/camera/projection.h"

namespace taclink::server {
namespace {

constexpr int64_t kNsPerS = 1'000'000'000;

// Compares the markers' images, not the parameters: position, tilt and lens are correlated and vary together
// between fits.
std::optional<CameraMove> MoveBetween(const LinkModel& model, const CameraModel& before,
                                      const CameraModel& now) {
  const Projector projector(now);
  std::vector<PointImage> images;
  for (const Vec3& marker_mm : model.RestMarkers()) {
    if (const auto pixel = projector.Project(marker_mm)) images.push_back({marker_mm, *pixel});
  }
  const auto shift = FindCameraShift(before, images);
  if (!shift) return std::nullopt;
  return CameraMove{*shift, IsLarge(*shift, model)};
}

}  // namespace

PipelineProcessor::PipelineProcessor(const LinkModel& model, const PipelineOptions& options,
                                     std::optional<std::string> file, CalibrationIdentity identity)
    : pipeline_(model, options), file_(std::move(file)), identity_(std::move(identity)) {}

void PipelineProcessor::Process(const StereoFrame& frame, LinkState& state) {
  pipeline_.Process(frame, state);
  // Without forces, the rest images themselves must show that nothing touches: calibration must remain
  // possible then.
  touched_ = !state.contacts.empty();
  calibrated_utc_ns_ = state.baseline.calibrated_utc_ns;
}

Result<void> PipelineProcessor::UseEstimator(std::shared_ptr<StateEstimator> estimator) {
  pipeline_.UseEstimator(std::move(estimator));
  return {};
}

Result<void> PipelineProcessor::BeginCalibration(const CalibrationOrder& order) {
  if (touched_ && !order.force)
    return Error{ErrorCode::kFailedPrecondition, "the skin is touched; let go of it, or ask with force"};
  if (order.save && !file_)
    return Error{ErrorCode::kFailedPrecondition,
                 "no file to save to: the link's configuration has no 'calibration'"};
  run_ = {.order = order, .done = {}, .before = {}, .before_utc_ns = calibrated_utc_ns_};
  if (const auto& now = pipeline_.calibration()) run_.before = now->rig;
  pipeline_.BeginRest(order.pairs);
  return {};
}

CalibrationProgress PipelineProcessor::PollCalibration() {
  const RestProgress& rest = pipeline_.rest_progress();
  const int done = static_cast<int>(run_.done.size());
  CalibrationProgress progress{.taken = done * run_.order.pairs + rest.taken,
                               .wanted = run_.order.repeats * run_.order.pairs,
                               .waiting_for = rest.waiting_for,
                               .end = {}};
  if (rest.refusal) {
    const std::string why = rest.refusal->message;
    pipeline_.CancelRest();
    progress.end = run_.done.empty() ? Error{ErrorCode::kFailedPrecondition, why} : Finish(why);
  } else if (rest.taken == rest.wanted) {
    run_.done.push_back(*pipeline_.calibration());  // set by the complete rest pairs
    if (done + 1 < run_.order.repeats) {
      pipeline_.BeginRest(run_.order.pairs);
    } else {
      progress.end = Finish("");
    }
  }
  return progress;
}

Result<CalibrationResult> PipelineProcessor::Finish(std::string ended_early) const {
  const CalibrationSummary& found = run_.done.back();
  const LinkModel& model = pipeline_.model();
  CalibrationIdentity identity = identity_;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  identity.made_utc_s = std::chrono::duration_cast<std::chrono::seconds>(now).count();
  CalibrationResult result{.markers_used = found.markers_used,
                           .rms_px = found.rms_px,
                           .rmse_r_mm = found.rmse_r_mm,
                           .rmse_tangential_mm = found.rmse_phi_r_mm,
                           .rmse_z_mm = found.rmse_z_mm,
                           .file_text = CalibrationText(model, found, identity),
                           .saved_to = {},
                           .parameters = ParametersOf(run_.done, model.nominal_rig),
                           .repeats = static_cast<int>(run_.done.size()),
                           .ended_early = std::move(ended_early),
                           .previous_utc_ns = run_.before_utc_ns,
                           .moves = {}};
  if (run_.before) {
    for (const CameraId id : kBothCameras)
      result.moves[Index(id)] = MoveBetween(model, (*run_.before)[id], found.rig[id]);
  }
  if (run_.order.save) {
    const auto saved = SaveCalibration(*file_, result.file_text, run_.order.may_save);
    if (!saved) return saved.error();
    result.saved_to = *file_;
  }
  return result;
}

}  // namespace taclink::server

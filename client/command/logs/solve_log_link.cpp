#include "client/command/logs/solve_log_link.h"

#include <Eigen/Eigenvalues>
#include <chrono>
#include <utility>

#include "sensing/capture/decode.h"
#include "sensing/pipeline/judge.h"
#include "wire/frame_codec.h"
#include "wire/log/picture.h"
#include "wire/log/scene.h"

namespace taclink::command {
namespace {

// Keeps what the covariance says of nothing invertible.
constexpr double kLeastVarianceMm2 = 1e-8;

bool HasPicture(const RecordedPictures& pictures) {
  return pictures[0] || pictures[1];
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Why a camera gave no picture stands in the log only as a part of the status.
std::string WhyMissing(CameraId camera, const std::string& status_reason) {
  const std::string mark = std::string("no picture from the ") + Name(camera) + " camera: ";
  const size_t at = status_reason.find(mark);
  return at == std::string::npos ? "" : status_reason.substr(at + mark.size());
}

// The log has what the cameras and the skin's mechanics say together. Of a marker that one camera sees, the
// direction that is known worst is the mechanics' guess.
Mat3 Information(const Mat3& covariance_mm2, MarkerSource source) {
  if (source == MarkerSource::kInferred || !covariance_mm2.allFinite()) return Mat3::Zero();
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(covariance_mm2);
  Vec3 information = axes.eigenvalues().cwiseMax(kLeastVarianceMm2).cwiseInverse();
  if (source != MarkerSource::kBoth) information[2] = 0;  // eigenvalues increase
  return axes.eigenvectors() * information.asDiagonal() * axes.eigenvectors().transpose();
}

void MeasureAgain(SkinShape& shape) {
  shape.measured.resize(shape.displacements_mm.size());
  for (size_t m = 0; m < shape.measured.size(); ++m) {
    shape.measured[m] = {.displacement_mm = shape.displacements_mm[m],
                         .information_per_mm2 = Information(shape.covariances_mm2[m], shape.sources[m])};
  }
}

// Forces and contacts of `from`; the rest of `to` stays as it was recorded.
void TakeForces(v1::LinkFrame& from, v1::LinkFrame& to) {
  to.mutable_contacts()->Swap(from.mutable_contacts());
  if (from.has_total_force_n())
    *to.mutable_total_force_n() = from.total_force_n();
  else
    to.clear_total_force_n();
  to.set_force_model(from.force_model());
  to.mutable_nodal_forces_n()->Swap(from.mutable_nodal_forces_n());
  to.mutable_nodal_force_sigmas_n()->Swap(from.mutable_nodal_force_sigmas_n());
  to.mutable_detection_limits_n()->Swap(from.mutable_detection_limits_n());
  if (from.has_detection_limit_n())
    to.set_detection_limit_n(from.detection_limit_n());
  else
    to.clear_detection_limit_n();
  if (from.has_detection_limit_around_n())
    to.set_detection_limit_around_n(from.detection_limit_around_n());
  else
    to.clear_detection_limit_around_n();
  if (from.has_force_residual())
    to.set_force_residual(from.force_residual());
  else
    to.clear_force_residual();
  // Of the recorded markers it is off already; older logs do not tell it.
  if (!to.has_camera_shift_m() && from.has_camera_shift_m()) to.set_camera_shift_m(from.camera_shift_m());
  to.set_force_not_converged(from.force_not_converged());
  to.mutable_stage_times()->set_force_s(from.stage_times().force_s());
  to.set_status(from.status());
  to.set_status_reason(from.status_reason());
  to.mutable_status_reasons()->Swap(from.mutable_status_reasons());
}

}  // namespace

LogLinkSolver::LogLinkSolver(const LinkSettings& settings, bool from_pictures) : settings_(settings) {
  report_.name = settings.name;
  report_.from_pictures = from_pictures;
  report_.changes = settings.changes;
  report_.warnings = settings.warnings;
  if (from_pictures) return;
  report_.warnings.emplace_back(
      "the log has none of its pictures: forces and contacts are solved from the recorded markers, which "
      "differs a "
      "little from solving pictures");
  if (settings.new_calibration)
    report_.warnings.emplace_back("the new calibration changes nothing without pictures");
}

void LogLinkSolver::Begin() {
  if (report_.from_pictures && !pipeline_)
    pipeline_ = std::make_unique<LinkPipeline>(settings_.model, settings_.options);
  if (!report_.from_pictures && !estimator_) {
    estimator_ = MakeStateEstimator(settings_.model, settings_.options.force);
    finder_ = std::make_unique<ContactFinder>(settings_.model, settings_.options.contact);
  }
}

Result<std::string> LogLinkSolver::Solve(const std::string& recorded_bytes,
                                         const RecordedPictures& pictures) {
  v1::LinkFrame recorded;
  if (!recorded.ParseFromString(recorded_bytes))
    return Error{ErrorCode::kInvalidArgument,
                 "a frame of link '" + settings_.name + "' is no LinkFrame message"};
  auto decoded = wire::FromWire(recorded);
  if (!decoded) return decoded.error();
  recorded_ = std::move(decoded->state);
  solved_newest_ = false;
  if (recorded_.times.exposure_monotonic_ns == 0) return recorded_bytes;  // a report
  NoteFrame();
  const bool solvable = report_.from_pictures ? HasPicture(pictures) : recorded_.measured();
  Begin();
  if (!report_.from_pictures) FollowLoads();
  if (!solvable) return recorded_bytes;
  v1::LinkFrame solved = recorded;
  const auto done = report_.from_pictures ? SolvePictures(pictures, solved) : SolveMarkers(solved);
  if (!done) return done.error();
  solved_newest_ = true;
  Compare(recorded, recorded_bytes, report_.recorded_s, solved, report_);
  return solved.SerializeAsString();
}

void LogLinkSolver::NoteFrame() {
  if (report_.frames++ == 0) {
    first_utc_ns_ = recorded_.times.exposure_utc_ns;
    if (report_.from_pictures && recorded_.baseline.origin != BaselineOrigin::kNone) {
      report_.warnings.emplace_back(
          "the recording began when the link was measuring already: its rest shape is taken from the first "
          "pictures of the log, in which something may touch it");
    }
  }
  report_.recorded_s = static_cast<double>(recorded_.times.exposure_utc_ns - first_utc_ns_) * 1e-9;
}

Result<void> LogLinkSolver::SolvePictures(const RecordedPictures& pictures, v1::LinkFrame& solved) {
  frame_.sequence = recorded_.sequence;
  frame_.times = {.exposure_monotonic_ns = recorded_.times.exposure_monotonic_ns,
                  .exposure_utc_ns = recorded_.times.exposure_utc_ns,
                  .received_ns = recorded_.times.received_ns};
  frame_.pressure_mpa = recorded_.pressure_mpa;
  frame_.pressure = recorded_.pressure;
  frame_.specific_force = recorded_.specific_force;
  for (const CameraId camera : kBothCameras) {
    auto image = Image(camera, pictures[Index(camera)]);
    if (!image) return image.error();
    frame_.images[Index(camera)] = std::move(*image);
  }
  const auto start = std::chrono::steady_clock::now();
  pipeline_->Process(frame_, state_);
  report_.solve_s += SecondsSince(start);
  state_.times = recorded_.times;
  const bool replayed = solved.replayed(), is_simulated = solved.has_simulation();
  // What was true then, bit for bit: it does not pass through the domain's units.
  const v1::SimulationReport simulation = solved.simulation();
  wire::Fill({solved.link(), solved.link_index()}, state_, Detail::kFull, solved);
  solved.set_replayed(replayed);
  if (is_simulated) *solved.mutable_simulation() = simulation;
  return {};
}

Result<RawImage> LogLinkSolver::Image(CameraId camera, const std::optional<RecordedPicture>& picture) const {
  if (!picture) {
    RawImage missing;
    missing.why_missing = WhyMissing(camera, recorded_.status_reason);
    return missing;
  }
  auto image = wire::log::DecodePicture(picture->type, *picture->bytes);
  if (!image || image->format != PixelFormat::kMjpeg) return image;
  const StereoRig& rig = settings_.options.rig ? *settings_.options.rig : settings_.model.nominal_rig;
  const auto size = JpegSize(image->bytes);
  image->width_px = size ? size->width_px : rig[camera].width_px;  // the pipeline says what is wrong with it
  image->height_px = size ? size->height_px : rig[camera].height_px;
  return image;
}

// As LinkPipeline::Process has it.
bool LogLinkSolver::IsPressureTold() const {
  return !recorded_.pressure.stale && (recorded_.pressure_mpa || settings_.options.pressure_mpa ||
                                       recorded_.pressure.origin != PressureOrigin::kNone);
}
double LogLinkSolver::FramePressure() const {
  if (recorded_.pressure.stale) return recorded_.pressure.mpa;
  // Nobody told it: the shape did.
  if (!IsPressureTold() && recorded_.pressure_estimate) return recorded_.pressure_estimate->mpa;
  return recorded_.pressure_mpa.value_or(settings_.options.pressure_mpa.value_or(0));
}

MeasuredLoads LogLinkSolver::MeasuredInFrame() const {
  MeasuredLoads loads{.pressure_mpa = FramePressure(),
                      .pressure_sigma_mpa = settings_.options.pressure_sigma_mpa.value_or(
                          PressureSigma(recorded_.pressure.origin))};
  if (!recorded_.specific_force) return loads;
  loads.specific_force_mps2 = recorded_.specific_force->mps2;
  loads.specific_force_covariance = recorded_.specific_force->covariance;
  return loads;
}

// The known loads as the frame was solved with; what a frame's estimate found is what a baseline taken in it
// has. A baseline is taken with the frame before the first that is measured against it.
void LogLinkSolver::FollowLoads() {
  const MeasuredLoads measured = MeasuredInFrame();
  loads_.now = estimator_->BeginFrame(
      measured,
      {.pressure = IsPressureTold(),
       .specific_force = recorded_.specific_force.has_value() && !IsAttitudeUnknown(measured)},
      recorded_.times.exposure_monotonic_ns);
  MeasuredLoads now = loads_.now;
  if (recorded_.measured() && recorded_.baseline.taken_utc_ns != baseline_utc_ns_) {
    baseline_utc_ns_ = recorded_.baseline.taken_utc_ns;
    if (recorded_.baseline.origin == BaselineOrigin::kForcedTare) estimator_->ForgetContacts();
    loads_.baseline = before_.value_or(now);
    if (!before_ && (recorded_.pressure_mpa || recorded_.specific_force)) {
      report_.warnings.emplace_back(
          "the pressure and attitude in which the baseline was taken are not in the log: those of the first "
          "frame stand in");
    }
  }
  if (const auto& estimate = recorded_.specific_force_estimate; estimate && recorded_.specific_force) {
    now.specific_force_mps2 = estimate->mps2 + now.by_creep.tail<3>();
    now.specific_force_covariance = estimate->covariance;
  }
  before_ = now;
}

Result<void> LogLinkSolver::SolveMarkers(v1::LinkFrame& solved) {
  const auto markers = static_cast<size_t>(settings_.model.markers.count());
  const SkinShape& shape = recorded_.shape;
  if (shape.displacements_mm.empty() || shape.covariances_mm2.empty() || shape.sources.empty()) {
    return Error{
        ErrorCode::kFailedPrecondition,
        "link '" + settings_.name + "': the log has none of its pictures, and frame " +
            std::to_string(recorded_.sequence) +
            " is not of full detail: there is nothing to solve. Leave the link out, or record with pictures"};
  }
  if (shape.displacements_mm.size() != markers) {
    return Error{ErrorCode::kInvalidArgument,
                 "link '" + settings_.name + "': frame " + std::to_string(recorded_.sequence) + " has " +
                     std::to_string(shape.displacements_mm.size()) + " markers, model '" +
                     settings_.model.name + "' has " + std::to_string(markers) +
                     ": another number of markers takes pictures"};
  }
  state_ = std::move(recorded_);
  MeasureAgain(state_.shape);
  SolveForces();
  v1::LinkFrame forces;
  wire::Fill({solved.link(), solved.link_index()}, state_, Detail::kFull, forces);
  TakeForces(forces, solved);
  return {};
}

void LogLinkSolver::SolveForces() {
  const auto start = std::chrono::steady_clock::now();
  estimator_->Estimate(loads_, state_.shape, state_.forces);
  estimator_->FindContacts(*finder_, state_.shape, state_.forces, state_.contacts);
  const double seconds = SecondsSince(start);
  state_.stage_ms.force = seconds * 1e3;
  report_.solve_s += seconds;
  state_.total_force_n.setZero();
  for (const Contact& contact : state_.contacts) state_.total_force_n += contact.force_n;
  const SkinEstimate& estimate = estimator_->estimate();
  estimator_->WriteKnownLoads(state_);
  // What the pictures were like, the log knows.
  std::optional<Reason> trouble, late;
  if (state_.status != LinkStatus::kOk && state_.reasons.empty())
    trouble = Reason{ReasonId::kCamera, state_.status_reason};
  for (const Reason& reason : state_.reasons) {
    const bool is_of_pictures = reason.id == ReasonId::kCamera || reason.id == ReasonId::kFrozen ||
                                reason.id == ReasonId::kCamerasDisagree || reason.id == ReasonId::kLate ||
                                reason.id == ReasonId::kCamerasMoved;
    if (is_of_pictures && !trouble) trouble = reason;
    if (reason.id == ReasonId::kLateFrame) late = reason;
  }
  Judge({.model = settings_.model,
         .camera_trouble = trouble,
         .agreement = {},
         .motion = {},
         .sees_alone = {},
         .attitude = {},
         .attitude_error_mm = estimator_->AttitudeErrorMm(),
         .drift = {},
         .measured = loads_.now.Real(),
         .is_pressure_measured = IsPressureTold(),
         .baseline = loads_.baseline.Real(),
         .estimate = estimate},
        state_);
  if (state_.has_forces()) estimator_->EndFrame();
  if (late) Degrade(state_, *std::move(late));
}

std::string LogLinkSolver::Scene(int64_t utc_ns) const {
  foxglove::SceneUpdate scene;
  wire::log::Fill(settings_.name, settings_.model.markers, solved_newest_ ? state_ : recorded_, utc_ns,
                  scene);
  return scene.SerializeAsString();
}

}  // namespace taclink::command

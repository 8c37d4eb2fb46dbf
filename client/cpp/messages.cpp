#include "client/cpp/messages.h"

#include <algorithm>
#include <cctype>
#include <cmath>

namespace taclink::client {
namespace {

Supervision From(v1::Supervision supervision) {
  switch (supervision) {
    case v1::SUPERVISION_RUNNING:
      return Supervision::kRunning;
    case v1::SUPERVISION_OVERDUE:
      return Supervision::kOverdue;
    case v1::SUPERVISION_RESTARTING:
      return Supervision::kRestarting;
    case v1::SUPERVISION_RESTING:
      return Supervision::kResting;
    default:
      return Supervision::kUnknown;
  }
}

using Floats = google::protobuf::RepeatedField<float>;

Vector3 From(const v1::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

template <size_t N>
std::vector<std::array<double, N>> Grouped(const Floats& values) {
  std::vector<std::array<double, N>> out(static_cast<size_t>(values.size()) / N);
  int next = 0;
  for (auto& group : out) {
    for (double& value : group) value = static_cast<double>(values[next++]);
  }
  return out;
}

LinkStatus From(v1::LinkStatus status) {
  switch (status) {
    case v1::LINK_STATUS_STARTING:
      return LinkStatus::kStarting;
    case v1::LINK_STATUS_CALIBRATING:
      return LinkStatus::kCalibrating;
    case v1::LINK_STATUS_OK:
      return LinkStatus::kOk;
    case v1::LINK_STATUS_DEGRADED:
      return LinkStatus::kDegraded;
    case v1::LINK_STATUS_LOST:
      return LinkStatus::kLost;
    default:
      return LinkStatus::kUnknown;
  }
}

static_assert(static_cast<int>(Reason::kFewMarkers) == v1::REASON_FEW_MARKERS &&
              static_cast<int>(Reason::kForcedBaseline) == v1::REASON_FORCED_BASELINE &&
              v1::Reason_MAX == v1::REASON_FORCED_BASELINE);
StatusReason From(const v1::StatusReason& message) {
  StatusReason reason;
  reason.id = message.id();
  reason.text = message.text();
  // All versions send the name.
  std::string name = "REASON_" + message.id();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  if (v1::Reason known; v1::Reason_Parse(name, &known)) reason.reason = static_cast<Reason>(known);
  if (message.has_value()) reason.value = message.value();
  if (message.has_limit()) reason.limit = message.limit();
  reason.unit = message.unit();
  return reason;
}

ForceModel From(v1::ForceModel model) {
  switch (model) {
    case v1::FORCE_MODEL_LITERAL:
      return ForceModel::kLiteral;
    case v1::FORCE_MODEL_LINEAR:
      return ForceModel::kLinear;
    case v1::FORCE_MODEL_PRESSURISED:
      return ForceModel::kPressurised;
    case v1::FORCE_MODEL_NONLINEAR:
      return ForceModel::kNonlinear;
    default:
      return ForceModel::kUnknown;
  }
}

MarkerSource From(v1::MarkerSource source) {
  switch (source) {
    case v1::MARKER_SOURCE_BOTH:
      return MarkerSource::kBoth;
    case v1::MARKER_SOURCE_TOP:
      return MarkerSource::kTop;
    case v1::MARKER_SOURCE_BOTTOM:
      return MarkerSource::kBottom;
    case v1::MARKER_SOURCE_INFERRED:
      return MarkerSource::kInferred;
    default:
      return MarkerSource::kUnknown;
  }
}

SourceKind From(v1::SourceKind kind) {
  switch (kind) {
    case v1::SOURCE_KIND_V4L2:
      return SourceKind::kV4l2;
    case v1::SOURCE_KIND_FILES:
      return SourceKind::kFiles;
    case v1::SOURCE_KIND_SIMULATED:
      return SourceKind::kSimulated;
    case v1::SOURCE_KIND_LOG:
      return SourceKind::kLog;
    default:
      return SourceKind::kUnknown;
  }
}

LinkModel From(const v1::LinkModel& message) {
  LinkModel model;
  model.name = message.name();
  model.description = message.description();
  model.length_m = message.length_m();
  model.thickness_m = message.thickness_m();
  model.tube_radius_m = message.tube_radius_m();
  model.youngs_modulus_pa = message.material().youngs_modulus_pa();
  model.poisson_ratio = message.material().poisson_ratio();
  const v1::MarkerGrid& grid = message.markers();
  model.paths = static_cast<int>(grid.paths());
  model.rings = static_cast<int>(grid.rings());
  model.first_path_angle_rad = grid.first_path_angle_rad();
  model.ring_z_m.assign(grid.ring_z_m().begin(), grid.ring_z_m().end());
  model.marker_diameter_m = grid.diameter_m();
  model.rest_positions_m = Grouped<3>(grid.rest_positions_m());
  model.profile_z_m.assign(message.profile_z_m().begin(), message.profile_z_m().end());
  model.profile_radius_m.assign(message.profile_radius_m().begin(), message.profile_radius_m().end());
  return model;
}

Camera From(const v1::Camera& message) {
  Camera camera = {.name = message.name(),
                   .configured = message.configured(),
                   .device = message.device(),
                   .format = message.format(),
                   .trouble = message.trouble(),
                   .rate_hz = message.rate_hz(),
                   .pictures = message.pictures(),
                   .lost = message.lost(),
                   .damaged = message.damaged(),
                   .undecodable = message.undecodable(),
                   .unpaired = message.unpaired(),
                   .stamped_on_arrival = message.stamped_on_arrival()};
  if (message.has_automatic_exposure()) camera.automatic_exposure = message.automatic_exposure();
  if (message.has_exposure_s()) camera.exposure_s = message.exposure_s();
  if (message.has_gain()) camera.gain = message.gain();
  return camera;
}

Link From(const v1::Link& message) {
  Link link;
  link.name = message.name();
  link.index = static_cast<int>(message.index());
  link.model = From(message.model());
  link.base_from_link = FromMessage(message.base_from_link());
  link.frame = message.frame();
  link.source = From(message.source().kind());
  link.source_description = message.source().description();
  link.status = From(message.status());
  link.status_reason = message.status_reason();
  const v1::LinkStatistics& statistics = message.statistics();
  link.rate_hz = statistics.rate_hz();
  link.latency_p50_s = statistics.latency_p50_s();
  link.latency_p99_s = statistics.latency_p99_s();
  link.frames = statistics.frames();
  link.frames_skipped = statistics.frames_skipped();
  link.source_restarts = statistics.source_restarts();
  link.contacts = static_cast<int>(statistics.contacts());
  link.supervision = From(message.supervision());
  link.supervision_reason = message.supervision_reason();
  link.worker_restarts = statistics.worker_restarts();
  link.stage_overruns = statistics.stage_overruns();
  link.workers_abandoned = statistics.workers_abandoned();
  link.last_failure = statistics.last_failure();
  link.pairs_skipped = statistics.pairs_skipped();
  for (const auto& camera : message.cameras()) link.cameras.push_back(From(camera));
  for (const auto& state : message.force_levels()) link.force_levels.push_back(FromMessage(state));
  link.baseline = FromMessage(message.baseline());
  return link;
}

Joint From(const v1::Joint& message) {
  Joint joint;
  joint.name = message.name();
  if (message.has_lower()) joint.lower = message.lower();
  if (message.has_upper()) joint.upper = message.upper();
  if (message.has_position()) joint.position = message.position();
  joint.position_age_s = message.position_age_s();
  return joint;
}

std::optional<Covariance3> From(const google::protobuf::RepeatedField<double>& covariance) {
  Covariance3 numbers{};
  if (static_cast<size_t>(covariance.size()) != numbers.size()) return std::nullopt;
  std::copy(covariance.begin(), covariance.end(), numbers.begin());
  return numbers;
}

const char* Name(v1::PressureOrigin origin) {
  switch (origin) {
    case v1::PRESSURE_ORIGIN_CONSTANT:
      return "constant";
    case v1::PRESSURE_ORIGIN_SIMULATED:
      return "simulated";
    case v1::PRESSURE_ORIGIN_FILE:
      return "file";
    case v1::PRESSURE_ORIGIN_SERIAL:
      return "serial";
    case v1::PRESSURE_ORIGIN_CLIENT:
      return "client";
    default:
      return "none";
  }
}

PressureReport From(const v1::PressureReport& message) {
  PressureReport report;
  report.origin = Name(message.origin());
  report.assumed = message.assumed() || message.origin() == v1::PRESSURE_ORIGIN_UNSPECIFIED;
  report.stale = message.stale();
  report.pressure_pa = message.pressure_pa();
  if (message.has_age_s()) report.age_s = message.age_s();
  report.trouble = message.trouble();
  return report;
}

Contact From(const v1::Contact& message) {
  Contact contact;
  contact.id = message.id();
  contact.center_m = From(message.center_m());
  contact.normal = From(message.normal());
  contact.force_n = From(message.force_n());
  contact.force_covariance_n2 = From(message.force_covariance_n2());
  contact.center_covariance_m2 = From(message.center_covariance_m2());
  contact.normal_force_n = message.normal_force_n();
  contact.area_m2 = message.area_m2();
  contact.is_ring_contact = message.is_ring_contact();
  for (const uint32_t marker : message.markers()) contact.markers.push_back(static_cast<int>(marker));
  contact.moment_nm = From(message.moment_nm());
  contact.peak_pressure_pa = message.peak_pressure_pa();
  contact.major_axis_m = From(message.major_axis_m());
  contact.minor_axis_m = From(message.minor_axis_m());
  contact.outline_m = Grouped<3>(message.outline_m());
  return contact;
}

FrameTimes From(const v1::FrameTimes& message) {
  return {.exposure_utc_ns = message.exposure_utc_ns(),
          .exposure_ns = message.exposure_ns(),
          .received_ns = message.received_ns(),
          .tracked_ns = message.tracked_ns(),
          .solved_ns = message.solved_ns(),
          .published_ns = message.published_ns()};
}

}  // namespace

Vector3 Sigmas(const Covariance3& covariance) {
  const auto root = [](double variance) { return std::sqrt(std::max(0.0, variance)); };
  return {root(covariance[0]), root(covariance[3]), root(covariance[5])};
}

const char* Name(LinkStatus status) {
  switch (status) {
    case LinkStatus::kStarting:
      return "starting";
    case LinkStatus::kCalibrating:
      return "calibrating";
    case LinkStatus::kOk:
      return "ok";
    case LinkStatus::kDegraded:
      return "degraded";
    case LinkStatus::kLost:
      return "lost";
    case LinkStatus::kUnknown:
      break;
  }
  return "unknown";
}

const char* Name(ForceModel model) {
  switch (model) {
    case ForceModel::kLiteral:
      return "literal";
    case ForceModel::kLinear:
      return "linear";
    case ForceModel::kPressurised:
      return "pressurised";
    case ForceModel::kNonlinear:
      return "nonlinear";
    case ForceModel::kAuto:
      return "auto";
    case ForceModel::kUnknown:
      break;
  }
  return "unknown";
}

const char* Name(Supervision supervision) {
  switch (supervision) {
    case Supervision::kRunning:
      return "running";
    case Supervision::kOverdue:
      return "overdue";
    case Supervision::kRestarting:
      return "restarting";
    case Supervision::kResting:
      return "resting";
    case Supervision::kUnknown:
      break;
  }
  return "unknown";
}

const char* Name(SourceKind kind) {
  switch (kind) {
    case SourceKind::kV4l2:
      return "v4l2";
    case SourceKind::kFiles:
      return "files";
    case SourceKind::kSimulated:
      return "simulated";
    case SourceKind::kLog:
      return "log";
    case SourceKind::kUnknown:
      break;
  }
  return "unknown";
}

Vector3 FromMessage(const v1::Vector3& message) {
  return From(message);
}

Pose FromMessage(const v1::Pose& message) {
  const v1::Quaternion& q = message.rotation();
  return {From(message.translation_m()), {q.x(), q.y(), q.z(), q.w()}};
}

LinkStatus FromMessage(v1::LinkStatus status) {
  return From(status);
}

std::optional<Covariance3> FromMessage(const google::protobuf::RepeatedField<double>& covariance) {
  return From(covariance);
}

Arm FromMessage(const v1::Arm& message) {
  Arm arm{.name = message.name(), .server_version = message.server_version(), .links = {}};
  arm.base_frame = message.base_frame();
  for (const auto& joint : message.joints()) arm.joints.push_back(From(joint));
  for (const auto& link : message.links()) arm.links.push_back(From(link));
  return arm;
}

Frame FromMessage(const v1::LinkFrame& message) {
  Frame frame;
  frame.link = message.link();
  frame.link_index = static_cast<int>(message.link_index());
  frame.sequence = message.sequence();
  frame.times = From(message.times());
  frame.status = From(message.status());
  frame.status_reason = message.status_reason();
  if (message.has_pressure_pa()) frame.pressure_pa = message.pressure_pa();
  frame.pressure = From(message.pressure());
  for (const auto& reason : message.status_reasons()) frame.status_reasons.push_back(From(reason));
  if (message.has_pressure_estimate())
    frame.pressure_estimate = {message.pressure_estimate().pressure_pa(),
                               message.pressure_estimate().sigma_pa()};
  frame.markers_seen = static_cast<int>(message.markers_seen());
  frame.markers_inferred = static_cast<int>(message.markers_inferred());
  for (const auto& contact : message.contacts()) frame.contacts.push_back(From(contact));
  if (message.has_total_force_n()) frame.total_force_n = From(message.total_force_n());
  frame.unchanged = message.unchanged();
  frame.replayed = message.replayed();
  frame.force_model = From(message.force_model());
  frame.baseline_age_s = message.baseline_age_s();
  frame.baseline = FromMessage(message.baseline());
  frame.tracked = message.tracking_mode() == v1::TRACKING_MODE_TRACKED;
  for (const auto& camera : message.cameras())
    frame.picture_share += static_cast<double>(camera.share_read()) / message.cameras_size();
  const v1::StageTimes& stages = message.stage_times();
  frame.stage_times = {.decode_s = stages.decode_s(),
                       .detect_s = stages.detect_s(),
                       .register_s = stages.register_s(),
                       .reconstruct_s = stages.reconstruct_s(),
                       .force_s = stages.force_s()};
  frame.positions_m = Grouped<3>(message.positions_m());
  frame.displacements_m = Grouped<3>(message.displacements_m());
  frame.displacement_covariances_m2 = Grouped<6>(message.displacement_covariances_m2());
  frame.nodal_forces_n = Grouped<3>(message.nodal_forces_n());
  frame.nodal_force_sigmas_n.assign(message.nodal_force_sigmas_n().begin(),
                                    message.nodal_force_sigmas_n().end());
  for (const int source : message.marker_sources())
    frame.marker_sources.push_back(From(static_cast<v1::MarkerSource>(source)));
  frame.detection_limits_n.assign(message.detection_limits_n().begin(), message.detection_limits_n().end());
  if (message.has_detection_limit_n()) frame.detection_limit_n = message.detection_limit_n();
  if (message.has_detection_limit_around_n())
    frame.detection_limit_around_n = message.detection_limit_around_n();
  if (message.has_force_residual()) frame.force_residual = message.force_residual();
  if (message.has_camera_shift_m()) frame.camera_shift_m = message.camera_shift_m();
  frame.force_converged = !message.force_not_converged();
  return frame;
}

std::vector<StreamCounts> FromMessage(const v1::StreamStatus& message) {
  std::vector<StreamCounts> counts;
  for (const auto& link : message.links())
    counts.push_back({link.link(), link.frames_sent(), link.frames_dropped(), link.frames_dropped_for_bytes(),
                      link.frames_unchanged()});
  return counts;
}

v1::StreamFramesRequest ToMessage(const StreamOptions& options) {
  v1::StreamFramesRequest request;
  for (const auto& link : options.links) request.add_links(link);
  request.set_detail(options.detail == Detail::kFull       ? v1::DETAIL_FULL
                     : options.detail == Detail::kGeometry ? v1::DETAIL_GEOMETRY
                                                           : v1::DETAIL_CONTACTS);
  request.set_max_rate_hz(options.max_rate_hz);
  request.set_deadband_force_n(options.deadband_force_n);
  request.set_deadband_move_m(options.deadband_move_m);
  request.set_delivery(options.delivery == Delivery::kEvery ? v1::DELIVERY_EVERY : v1::DELIVERY_LATEST);
  return request;
}

CalibrationResult FromMessage(const v1::CalibrationResult& message) {
  return {.markers_used = static_cast<int>(message.markers_used()),
          .rms_px = message.rms_px(),
          .rmse_r_m = message.rmse_r_m(),
          .rmse_tangential_m = message.rmse_tangential_m(),
          .rmse_z_m = message.rmse_z_m(),
          .file_text = message.file_text(),
          .saved_to = message.saved_to()};
}

v1::ForceModel ToMessage(ForceModel model) {
  switch (model) {
    case ForceModel::kLiteral:
      return v1::FORCE_MODEL_LITERAL;
    case ForceModel::kLinear:
      return v1::FORCE_MODEL_LINEAR;
    case ForceModel::kPressurised:
      return v1::FORCE_MODEL_PRESSURISED;
    case ForceModel::kNonlinear:
      return v1::FORCE_MODEL_NONLINEAR;
    case ForceModel::kAuto:
      return v1::FORCE_MODEL_AUTO;
    case ForceModel::kUnknown:
      break;
  }
  return v1::FORCE_MODEL_UNSPECIFIED;
}

v1::CalibrateRequest ToMessage(const CalibrateOptions& options) {
  v1::CalibrateRequest message;
  message.set_link(options.link);
  message.set_pairs(static_cast<uint32_t>(options.pairs));
  message.set_save(options.save);
  message.set_force(options.force);
  return message;
}

}  // namespace taclink::client

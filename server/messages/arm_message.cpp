#include "server/messages/arm_message.h"

#include <algorithm>

#include "server/messages/contacts_message.h"
#include "server/messages/event_message.h"
#include "server/messages/pressure_message.h"
#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

v1::SourceKind ToWire(SourceKind kind) {
  switch (kind) {
    case SourceKind::kV4l2:
      return v1::SOURCE_KIND_V4L2;
    case SourceKind::kFiles:
      return v1::SOURCE_KIND_FILES;
    case SourceKind::kSimulated:
      return v1::SOURCE_KIND_SIMULATED;
    case SourceKind::kLog:
      return v1::SOURCE_KIND_LOG;
  }
  return v1::SOURCE_KIND_UNSPECIFIED;
}

void FillSource(SourceKind kind, const SourceInfo& info, v1::Source& out) {
  out.set_kind(ToWire(kind));
  out.set_description(info.description);
  out.set_width_px(static_cast<uint32_t>(info.width_px));
  out.set_height_px(static_cast<uint32_t>(info.height_px));
  out.set_frame_rate_hz(info.frame_rate_hz);
}

void FillFrameAge(const LinkState& state, int64_t now_ns, v1::LinkStatistics& out) {
  const int64_t exposure_ns = state.times.exposure_monotonic_ns;
  if (exposure_ns == 0 || state.replayed) return;
  out.set_frame_age_s(1e-9 * static_cast<double>(now_ns - exposure_ns));
}

void FillStatistics(const LinkStatistics& statistics, uint64_t restarts, v1::LinkStatistics& out) {
  out.set_rate_hz(statistics.rate_hz);
  out.set_latency_p50_s(statistics.latency_p50_ms * wire::kSecondsPerMs);
  out.set_latency_p99_s(statistics.latency_p99_ms * wire::kSecondsPerMs);
  out.set_frames(statistics.frames);
  out.set_frames_skipped(statistics.frames_skipped);
  out.set_source_restarts(restarts);
}

v1::Supervision ToWire(Supervision::State state) {
  switch (state) {
    case Supervision::State::kRunning:
      return v1::SUPERVISION_RUNNING;
    case Supervision::State::kOverdue:
      return v1::SUPERVISION_OVERDUE;
    case Supervision::State::kRestarting:
      return v1::SUPERVISION_RESTARTING;
    case Supervision::State::kResting:
      return v1::SUPERVISION_RESTING;
  }
  return v1::SUPERVISION_UNSPECIFIED;
}

void FillSupervision(const Supervision& supervision, v1::Link& out) {
  out.set_supervision(ToWire(supervision.state));
  out.set_supervision_reason(supervision.reason);
  v1::LinkStatistics& statistics = *out.mutable_statistics();
  statistics.set_worker_restarts(supervision.restarts);
  statistics.set_stage_overruns(supervision.overruns);
  statistics.set_workers_abandoned(supervision.abandoned);
  statistics.set_last_failure(supervision.last_failure);
}

void FillSettings(const CameraSettings& settings, v1::Camera& out) {
  if (settings.automatic_exposure || settings.exposure_100us)
    out.set_automatic_exposure(settings.automatic_exposure);
  if (settings.exposure_100us) out.set_exposure_s(*settings.exposure_100us * 1e-4);
  if (settings.gain) out.set_gain(*settings.gain);
}

void FillCameras(const SourceCondition& source, const LinkStatistics& statistics, v1::Link& out) {
  const SourceCounters& counters = source.counters;
  out.mutable_statistics()->set_pairs_skipped(counters.skipped_pairs);
  for (size_t i = 0; i < source.info.cameras.size() && i < kCameraCount; ++i) {
    const SourceCamera& camera = source.info.cameras[i];
    v1::Camera& message = *out.add_cameras();
    message.set_name(Name(kBothCameras[i]));
    message.set_configured(camera.configured);
    message.set_device(camera.device);
    message.set_format(camera.format);
    message.set_trouble(camera.trouble);
    message.set_rate_hz(counters.rate_hz[i]);
    message.set_pictures(counters.pictures[i]);
    message.set_lost(counters.lost[i]);
    message.set_damaged(counters.damaged[i]);
    message.set_undecodable(statistics.bad_pictures[i]);
    message.set_unpaired(counters.unpaired[i]);
    message.set_stamped_on_arrival(counters.stamped_on_arrival[i]);
    if (!camera.device.empty()) FillSettings(camera.settings, message);
  }
}

v1::JointKind ToWire(JointKind kind) {
  switch (kind) {
    case JointKind::kRevolute:
      return v1::JOINT_KIND_REVOLUTE;
    case JointKind::kContinuous:
      return v1::JOINT_KIND_CONTINUOUS;
    case JointKind::kPrismatic:
      return v1::JOINT_KIND_PRISMATIC;
  }
  return v1::JOINT_KIND_UNSPECIFIED;
}

// The base frame and the joints of the URDF, with their positions now.
void FillJoints(const Arm& arm, v1::Arm& out) {
  out.set_base_frame(arm.poses().base_frame());
  JointStateBuffer::Instant now;
  arm.poses().joints().At(arm.clock().MonotonicNs(), now);
  for (const JointInfo& joint : arm.poses().joints().joints()) {
    const auto i = static_cast<size_t>(out.joints_size());
    v1::Joint& message = *out.add_joints();
    message.set_name(joint.name);
    message.set_kind(ToWire(joint.kind));
    if (joint.limits) message.set_lower(joint.limits->lower);
    if (joint.limits) message.set_upper(joint.limits->upper);
    if (now.validity[i] == PoseValidity::kUnknown) continue;
    message.set_position(now.positions[i]);
    message.set_position_age_s(static_cast<double>(now.distance_ns[i]) * 1e-9);
  }
}

v1::VisualShape ToWire(VisualShape shape) {
  switch (shape) {
    case VisualShape::kBox:
      return v1::VISUAL_SHAPE_BOX;
    case VisualShape::kCylinder:
      return v1::VISUAL_SHAPE_CYLINDER;
    case VisualShape::kSphere:
      return v1::VISUAL_SHAPE_SPHERE;
  }
  return v1::VISUAL_SHAPE_UNSPECIFIED;
}

void FillVisuals(const Arm& arm, v1::Arm& out) {
  const ArmKinematics* const kinematics = arm.poses().kinematics();
  if (kinematics == nullptr) return;
  const std::vector<LinkPose> drawn = arm.poses().DrawnFrames(arm.clock().MonotonicNs());
  const std::vector<size_t>& frames = kinematics->drawn_frames();
  for (const ArmVisual& visual : kinematics->visuals()) {
    v1::Visual& message = *out.add_visuals();
    message.set_frame(kinematics->frame_name(visual.frame));
    const auto place = std::ranges::lower_bound(frames, visual.frame) - frames.begin();
    wire::Fill(drawn[static_cast<size_t>(place)].base_from_link, *message.mutable_base_from_frame());
    wire::Fill(visual.frame_from_visual, *message.mutable_frame_from_visual());
    message.set_shape(ToWire(visual.shape));
    wire::Fill(visual.size_mm, wire::kMetresPerMm, *message.mutable_size_m());
    for (int i = 0; visual.color && i < 3; ++i) message.add_color(static_cast<float>((*visual.color)[i]));
  }
}

}  // namespace

void Fill(const Arm& arm, v1::Arm& out) {
  out.set_name(arm.name());
  out.set_server_version(TACLINK_VERSION);
  FillJoints(arm, out);
  FillVisuals(arm, out);
  for (size_t i = 0; i < arm.links().size(); ++i) {
    const LinkDescription& link = arm.links()[i];
    const SourceCondition source = arm.worker(i).source_condition();
    v1::Link& message = *out.add_links();
    message.set_name(link.name);
    message.set_index(static_cast<uint32_t>(i));
    wire::Fill(link.model, *message.mutable_model());
    const LinkPose pose = arm.poses().At(i, arm.clock().MonotonicNs());
    wire::Fill(pose.base_from_link, *message.mutable_base_from_link());
    message.set_pose_validity(ToWire(pose.validity));
    message.set_frame(link.frame);
    FillSource(link.source, source.info, *message.mutable_source());
    const LinkStatistics statistics = arm.worker(i).Statistics();
    FillStatistics(statistics, source.restarts, *message.mutable_statistics());
    FillSupervision(arm.worker(i).supervision(), message);
    FillCameras(source, statistics, message);
    for (const LevelReport& report : arm.events().Levels(i))
      Fill(report, link.rules, *message.add_force_levels());
    if (auto acceptance = arm.acceptances().Summary(i))
      *message.mutable_acceptance() = *std::move(acceptance);
    if (const auto regulator = arm.regulator(i))
      Fill((*regulator)->Status(), (*regulator)->options(), *message.mutable_regulator());
    message.set_status(v1::LINK_STATUS_STARTING);
    if (const auto latest = arm.hub().Latest(i)) {
      message.set_status(wire::ToWire(latest->state().status));
      wire::Fill(latest->state().baseline, *message.mutable_baseline());
      message.set_status_reason(latest->state().status_reason);
      message.mutable_statistics()->set_contacts(static_cast<uint32_t>(latest->state().contacts.size()));
      FillFrameAge(latest->state(), arm.clock().MonotonicNs(), *message.mutable_statistics());
    }
  }
}

}  // namespace taclink::server

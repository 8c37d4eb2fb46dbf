#include "server/rpc/joint_state_call.h"

#include <memory>
#include <utility>

#include "server/joint_state_intake.h"
#include "server/replay/replay_link.h"

namespace taclink::server {
namespace {

JointMessage From(const v1::UpdateJointStatesRequest& request) {
  return {.names = {request.names().begin(), request.names().end()},
          .positions = {request.positions().begin(), request.positions().end()},
          .velocities = {request.velocities().begin(), request.velocities().end()},
          .utc_ns = request.utc_ns(),
          .monotonic_ns = request.monotonic_ns()};
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

}  // namespace

grpc::ServerReadReactor<v1::UpdateJointStatesRequest>* TakeJointStates(
    Arm& arm, UpdateRegistry& registry, v1::UpdateJointStatesResponse& response) {
  using Stream = UpdateStream<v1::UpdateJointStatesRequest>;
  auto intake = std::make_shared<JointStateIntake>(arm.poses(), arm.clock());
  auto stream = std::make_shared<Stream>(
      registry,
      [intake, plays_log = arm.plays_log()](const v1::UpdateJointStatesRequest& request) {
        return plays_log ? Result<void>(PlaysLog()) : intake->Take(From(request));
      },
      [intake, &response] {
        response.set_accepted(intake->counts().accepted);
        response.set_refused(intake->counts().refused);
        response.set_first_refusal(intake->counts().first_refusal);
      });
  stream->Begin(registry.Add(stream));
  return stream.get();  // the registry, or if refused itself, holds it until gRPC is done
}

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

}  // namespace taclink::server

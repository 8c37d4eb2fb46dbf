#include "server/rpc/joint_state_call.h"

#include <memory>
#include <utility>

#include "server/joint_state_intake.h"
#include "server/replay/replay_link.h"
#include "server/rpc/request_check.h"

namespace taclink::server {
namespace {

JointMessage From(const v1::UpdateJointStatesRequest& request) {
  return {.names = {request.names().begin(), request.names().end()},
          .positions = {request.positions().begin(), request.positions().end()},
          .velocities = {request.velocities().begin(), request.velocities().end()},
          .utc_ns = request.utc_ns(),
          .monotonic_ns = request.monotonic_ns()};
}

}  // namespace

grpc::ServerReadReactor<v1::UpdateJointStatesRequest>* TakeJointStates(
    Arm& arm, UpdateRegistry& registry, const Party& party, v1::UpdateJointStatesResponse& response) {
  using Stream = UpdateStream<v1::UpdateJointStatesRequest>;
  auto intake = std::make_shared<JointStateIntake>(arm.poses(), arm.clock());
  auto stream = std::make_shared<Stream>(
      registry,
      [intake, plays_log = arm.plays_log()](const v1::UpdateJointStatesRequest& request) {
        if (plays_log) return Result<void>(PlaysLog());
        if (const auto good = CheckRequest(request); !good)
          return Result<void>(intake->AtNextMessage(good.error()));
        return intake->Take(From(request));
      },
      [intake, &response] {
        response.set_accepted(intake->counts().accepted);
        response.set_refused(intake->counts().refused);
        response.set_first_refusal(intake->counts().first_refusal);
      });
  stream->Begin(registry.Add(stream, party));
  return stream.get();  // the registry, or if refused itself, holds it until gRPC is done
}

}  // namespace taclink::server

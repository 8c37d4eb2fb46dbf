#include "server/rpc/services/joint_state_call.h"

#include <memory>
#include <utility>

#include "server/arm/joint_state_intake.h"
#include "server/replay/replay_link.h"
#include "server/rpc/requests/request_check.h"
#include "taclink/v1/joints.pb.h"

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

grpc::ServerReadReactor<grpc::ByteBuffer>* TakeJointStates(Arm& arm, UpdateRegistry& registry,
                                                           const Party& party, grpc::ByteBuffer& response) {
  auto intake = std::make_shared<JointStateIntake>(arm.poses(), arm.clock());
  auto stream = std::make_shared<UpdateStream>(
      registry,
      [intake, plays_log = arm.plays_log()](const grpc::ByteBuffer& bytes) {
        if (plays_log) return Result<void>(PlaysLog());
        const auto request = ParseRequest<v1::UpdateJointStatesRequest>(bytes);
        if (!request) return Result<void>(intake->AtNextMessage(request.error()));
        return intake->Take(From(*request));
      },
      [intake] {
        v1::UpdateJointStatesResponse out;
        out.set_accepted(intake->counts().accepted);
        out.set_refused(intake->counts().refused);
        out.set_first_refusal(intake->counts().first_refusal);
        return ToBytes(out);
      },
      response);
  stream->Begin(registry.Add(stream, party));
  return stream.get();  // the registry, or if refused itself, holds it until gRPC is done
}

}  // namespace taclink::server

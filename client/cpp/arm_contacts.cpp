#include "client/cpp/taclink/arm_contacts.h"

#include <algorithm>
#include <utility>

#include "client/cpp/messages.h"
#include "client/cpp/stream_call.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

PoseValidity From(v1::PoseValidity validity) {
  return v1::PoseValidity_IsValid(validity) ? static_cast<PoseValidity>(validity)
                                            : PoseValidity::kUnspecified;
}
static_assert(static_cast<int>(PoseValidity::kUnknown) == v1::POSE_VALIDITY_UNKNOWN);

ArmContact From(const v1::ArmContact& message) {
  return {.id = message.id(),
          .link = message.link(),
          .link_index = static_cast<int>(message.link_index()),
          .center_m = FromMessage(message.center_m()),
          .normal = FromMessage(message.normal()),
          .force_n = FromMessage(message.wrench().force_n()),
          .moment_nm = FromMessage(message.wrench().moment_nm()),
          .force_covariance_n2 = FromMessage(message.force_covariance_n2()),
          .center_covariance_m2 = FromMessage(message.center_covariance_m2()),
          .normal_force_n = message.normal_force_n(),
          .area_m2 = message.area_m2(),
          .is_ring_contact = message.is_ring_contact(),
          .exposure_utc_ns = message.exposure_utc_ns(),
          .validity = From(message.validity())};
}

LinkContacts From(const v1::LinkContactsStatus& message) {
  return {.link = message.link(),
          .status = FromMessage(message.status()),
          .forces_unknown = message.forces_unknown(),
          .sequence = message.sequence(),
          .base_from_link = FromMessage(message.base_from_link()),
          .validity = From(message.validity()),
          .joint_state_distance_s = message.joint_state_distance_s()};
}

}  // namespace

ArmContacts FromMessage(const v1::StreamContactsResponse& message) {
  ArmContacts out;
  for (const auto& link : message.links()) out.links.push_back(From(link));
  for (const auto& contact : message.contacts()) out.contacts.push_back(From(contact));
  if (message.has_total()) {
    out.total_force_n = FromMessage(message.total().force_n());
    out.total_moment_nm = FromMessage(message.total().moment_nm());
  }
  const int joints = std::min(message.joint_names_size(), message.joint_torques_size());
  const bool sigmas = message.joint_torque_sigmas_size() == joints;
  for (int i = 0; i < joints; ++i) {
    out.joints.push_back(
        {.joint = message.joint_names(i), .torque_nm = message.joint_torques(i), .sigma_nm = {}});
    if (sigmas) out.joints.back().sigma_nm = message.joint_torque_sigmas(i);
  }
  out.validity = From(message.validity());
  out.sequence = message.sequence();
  out.utc_ns = message.utc_ns();
  return out;
}

const char* Name(PoseValidity validity) {
  switch (validity) {
    case PoseValidity::kFixed:
      return "fixed";
    case PoseValidity::kInterpolated:
      return "interpolated";
    case PoseValidity::kExtrapolated:
      return "extrapolated";
    case PoseValidity::kStale:
      return "stale";
    case PoseValidity::kUnknown:
      return "unknown";
    case PoseValidity::kUnspecified:
      break;
  }
  return "unspecified";
}

struct ContactReader::Call : StreamCall<v1::StreamContactsResponse> {
  using StreamCall::StreamCall;
  bool first_waits = true;  // the one that was read to see the server accept
};

ContactReader::ContactReader(std::unique_ptr<Call> call) : call_(std::move(call)) {}
ContactReader::~ContactReader() = default;

Result<ArmContacts> ContactReader::Next(milliseconds timeout) {
  if (!std::exchange(call_->first_waits, false)) {
    const auto read = call_->Read(system_clock::now() + timeout);
    if (!read) return read.error();
  }
  return FromMessage(call_->response);
}

void ContactReader::Cancel() {
  call_->Cancel();
}

Result<std::unique_ptr<ContactReader>> Client::StreamContacts(double max_rate_hz, milliseconds timeout) {
  using Call = ContactReader::Call;
  auto call = std::make_unique<Call>(connection_->address, connection_->channel);
  v1::StreamContactsRequest request;
  request.set_max_rate_hz(max_rate_hz);
  call->reader = connection_->stub->AsyncStreamContacts(&call->context, request, &call->queue,
                                                        Call::AsPointer(Call::kStart));
  if (const auto accepted = call->ReadFirst(timeout); !accepted) return accepted.error();
  return std::unique_ptr<ContactReader>(new ContactReader(std::move(call)));
}

struct JointStateWriter::Call {
  std::shared_ptr<Client::Connection> connection;
  grpc::ClientContext context;
  v1::UpdateJointStatesRequest request;
  v1::UpdateJointStatesResponse response;
  std::unique_ptr<grpc::ClientWriter<v1::UpdateJointStatesRequest>> writer;
  bool finished = false;

  ~Call() {
    if (!finished && writer) {
      context.TryCancel();
      static_cast<void>(writer->Finish());
    }
  }

  Result<JointStateSummary> Finish() {
    finished = true;
    const grpc::Status status = writer->Finish();
    if (!status.ok()) return FromStatus(status, connection->address);
    return JointStateSummary{.accepted = response.accepted(),
                             .refused = response.refused(),
                             .first_refusal = response.first_refusal()};
  }
};

JointStateWriter::JointStateWriter(std::unique_ptr<Call> call) : call_(std::move(call)) {}
JointStateWriter::~JointStateWriter() = default;

Result<void> JointStateWriter::Write(const JointStates& states) {
  if (call_->finished) return Error{ErrorCode::kFailedPrecondition, "the call has ended"};
  auto& request = call_->request;
  request.Clear();
  request.mutable_names()->Assign(states.names.begin(), states.names.end());
  request.mutable_positions()->Assign(states.positions.begin(), states.positions.end());
  request.mutable_velocities()->Assign(states.velocities.begin(), states.velocities.end());
  request.set_utc_ns(states.utc_ns);
  if (call_->writer->Write(request)) return {};
  const auto end = call_->Finish();
  return end ? Error{ErrorCode::kUnavailable, "the server ended the call early"} : end.error();
}

Result<JointStateSummary> JointStateWriter::Finish() {
  if (call_->finished) return Error{ErrorCode::kFailedPrecondition, "the call has ended"};
  call_->writer->WritesDone();
  return call_->Finish();
}

std::unique_ptr<JointStateWriter> Client::UpdateJointStates() {
  auto call = std::make_unique<JointStateWriter::Call>();
  call->connection = connection_;
  call->writer = connection_->stub->UpdateJointStates(&call->context, &call->response);
  return std::unique_ptr<JointStateWriter>(new JointStateWriter(std::move(call)));
}

}  // namespace taclink::client

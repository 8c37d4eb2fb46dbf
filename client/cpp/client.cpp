#include "client/cpp/taclink/client.h"

#include <optional>
#include <utility>

#include "client/cpp/channel.h"
#include "client/cpp/connection.h"
#include "client/cpp/patience.h"
#include "client/cpp/stream_call.h"
#include "taclink/v1/operations.grpc.pb.h"
#include "taclink/v1/pressure.grpc.pb.h"
#include "taclink/v1/simulation.grpc.pb.h"
#include "taclink/v1/tactile.grpc.pb.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

constexpr milliseconds kConnectPatience{3000};

using TactileStub = v1::TactileService::Stub;

Error NoServer(const std::string& address) {
  return {ErrorCode::kUnavailable,
          "no server answers at " + address +
              "; start taclinkd there or choose another with --server; a server with TLS needs --tls-ca, one "
              "with client_ca also --tls-certificate and --tls-key"};
}

// A raised patience applies to a server that is slow to answer, not to one that does not exist.
bool WaitForServer(grpc::Channel& channel, milliseconds patience) {
  const auto begin = system_clock::now();
  if (channel.WaitForConnected(begin + kConnectPatience)) return true;
  auto state = channel.GetState(true);
  while ((state == GRPC_CHANNEL_IDLE || state == GRPC_CHANNEL_CONNECTING) &&
         channel.WaitForStateChange(state, begin + patience))
    state = channel.GetState(true);
  return state == GRPC_CHANNEL_READY;
}

ErrorCode CodeOf(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::INVALID_ARGUMENT:
      return ErrorCode::kInvalidArgument;
    case grpc::StatusCode::NOT_FOUND:
      return ErrorCode::kNotFound;
    case grpc::StatusCode::UNAVAILABLE:
      return ErrorCode::kUnavailable;
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return ErrorCode::kTimeout;
    case grpc::StatusCode::FAILED_PRECONDITION:
      return ErrorCode::kFailedPrecondition;
    case grpc::StatusCode::OUT_OF_RANGE:
      return ErrorCode::kEndOfData;
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return ErrorCode::kResourceExhausted;
    case grpc::StatusCode::UNIMPLEMENTED:
      return ErrorCode::kUnsupported;
    case grpc::StatusCode::UNAUTHENTICATED:
      return ErrorCode::kUnauthenticated;
    case grpc::StatusCode::PERMISSION_DENIED:
      return ErrorCode::kPermissionDenied;
    case grpc::StatusCode::CANCELLED:
      return ErrorCode::kEndOfData;
    default:
      return ErrorCode::kInternal;
  }
}

}  // namespace

Error FromStatus(const grpc::Status& status, const std::string& address) {
  const ErrorCode code = CodeOf(status.error_code());
  if (code == ErrorCode::kUnavailable) {
    // The server's own answer (a link that restarts) and a lost connection have the same code.
    return {code, "the call to the server at " + address + " failed: " + status.error_message() +
                      "; try again, and check that the server runs"};
  }
  if (code == ErrorCode::kTimeout)
    return {code, "the server at " + address + " did not answer in time; try again"};
  if (code == ErrorCode::kUnsupported) {
    return {code, "the server at " + address + " does not offer this (" + status.error_message() +
                      "); use programs of the same version"};
  }
  return {code, status.error_message().empty()
                    ? "the server at " + address + " ended the call without a reason"
                    : status.error_message()};
}

struct FrameReader::Call : StreamCall<v1::StreamFramesResponse> {
  using StreamCall::StreamCall;
  void TakeStatus() {
    status = response.status();
    end_reason = status.end_reason();
  }

  bool IsTooOld(const v1::LinkFrame& frame) const {
    return max_age_s > 0 && LatencyS(frame).value_or(0) > max_age_s;
  }

  v1::StreamStatus status;
  double max_age_s = 0;  // 0: any
  uint64_t frames_too_old = 0;
};

FrameReader::FrameReader(std::unique_ptr<Call> call) : call_(std::move(call)) {}
FrameReader::~FrameReader() = default;

Result<v1::LinkFrame> FrameReader::Next(milliseconds timeout) {
  const auto deadline = system_clock::now() + timeout;
  while (true) {
    const auto read = call_->Read(deadline);
    if (!read) return read.error();
    if (call_->response.has_status()) call_->TakeStatus();
    if (!call_->response.has_frame()) continue;
    if (!call_->IsTooOld(call_->response.frame())) return std::move(*call_->response.mutable_frame());
    ++call_->frames_too_old;
  }
}

void FrameReader::SetMaxAge(std::chrono::nanoseconds max_age) {
  call_->max_age_s = std::chrono::duration<double>(max_age).count();
}

uint64_t FrameReader::frames_too_old() const {
  return call_->frames_too_old;
}

void FrameReader::Cancel() {
  call_->Cancel();
}

const v1::StreamStatus& FrameReader::status() const {
  return call_->status;
}

milliseconds Patience(milliseconds usual) {
  const auto patience = PatienceFromEnvironment(usual);
  return patience ? *patience : usual;  // Connect reports the error
}

Client::Client(std::shared_ptr<Connection> connection) : connection_(std::move(connection)) {}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

Result<Client> Client::Connect(const std::string& address, const Credentials& credentials) {
  auto channel = MakeChannel(address, credentials);
  if (!channel) return channel.error();
  if (!WaitForServer(**channel, Patience(kConnectPatience))) return NoServer(address);
  return Client(std::make_shared<Connection>(address, *std::move(channel)));
}

Result<Client> Client::Connect(const std::string& address, milliseconds timeout,
                               const Credentials& credentials) {
  auto channel = MakeChannel(address, credentials);
  if (!channel) return channel.error();
  if (!(*channel)->WaitForConnected(system_clock::now() + timeout)) return NoServer(address);
  return Client(std::make_shared<Connection>(address, *std::move(channel)));
}

Result<v1::Arm> Client::GetArm(milliseconds timeout) {
  auto response = connection_->Ask(&TactileStub::GetArm, v1::GetArmRequest(), timeout);
  if (!response) return response.error();
  return std::move(*response->mutable_arm());
}

Result<v1::GetForceHistoryResponse> Client::GetForceHistory(const v1::GetForceHistoryRequest& request,
                                                            milliseconds timeout) {
  return connection_->Ask(&TactileStub::GetForceHistory, request, timeout);
}

Result<void> Client::RestartLink(const std::string& link, milliseconds timeout) {
  const auto operations = v1::OperationsService::NewStub(connection_->channel);
  v1::RestartLinkRequest request;
  request.set_link(link);
  return WithoutValue(
      Ask(*operations, &v1::OperationsService::Stub::RestartLink, request, timeout, connection_->address));
}

Result<void> Client::Press(const v1::PressRequest& request, milliseconds timeout) {
  const auto simulation = v1::SimulationService::NewStub(connection_->channel);
  return WithoutValue(
      Ask(*simulation, &v1::SimulationService::Stub::Press, request, timeout, connection_->address));
}

Result<void> Client::Release(const std::string& link, uint64_t body_id, milliseconds timeout) {
  const auto simulation = v1::SimulationService::NewStub(connection_->channel);
  v1::ReleaseRequest request;
  request.set_link(link);
  request.set_body_id(body_id);
  return WithoutValue(
      Ask(*simulation, &v1::SimulationService::Stub::Release, request, timeout, connection_->address));
}

Result<void> Client::SetScenePressure(const v1::SetScenePressureRequest& request, milliseconds timeout) {
  const auto simulation = v1::SimulationService::NewStub(connection_->channel);
  return WithoutValue(Ask(*simulation, &v1::SimulationService::Stub::SetScenePressure, request, timeout,
                          connection_->address));
}

Result<void> Client::MoveSceneJoint(const v1::MoveSceneJointRequest& request, milliseconds timeout) {
  const auto simulation = v1::SimulationService::NewStub(connection_->channel);
  return WithoutValue(
      Ask(*simulation, &v1::SimulationService::Stub::MoveSceneJoint, request, timeout, connection_->address));
}

Result<v1::PressureRegulator> Client::SetPressure(const v1::SetPressureRequest& request,
                                                  milliseconds timeout) {
  const auto pressure = v1::PressureService::NewStub(connection_->channel);
  auto response =
      Ask(*pressure, &v1::PressureService::Stub::SetPressure, request, timeout, connection_->address);
  if (!response) return response.error();
  return std::move(*response->mutable_regulator());
}

Result<v1::PressureRegulator> Client::GetPressure(const std::string& link, milliseconds timeout) {
  const auto pressure = v1::PressureService::NewStub(connection_->channel);
  v1::GetPressureRequest request;
  request.set_link(link);
  auto response =
      Ask(*pressure, &v1::PressureService::Stub::GetPressure, request, timeout, connection_->address);
  if (!response) return response.error();
  return std::move(*response->mutable_regulator());
}

Result<void> Client::SetCamera(const v1::SetCameraRequest& request, milliseconds timeout) {
  return WithoutValue(connection_->Ask(&TactileStub::SetCamera, request, timeout));
}

Result<void> Client::SetForceModel(const std::string& link, v1::ForceModel model, milliseconds timeout) {
  v1::SetForceModelRequest request;
  request.set_link(link);
  request.set_model(model);
  return WithoutValue(connection_->Ask(&TactileStub::SetForceModel, request, timeout));
}

Result<v1::TareResponse> Client::Tare(const v1::TareRequest& request, milliseconds timeout) {
  return connection_->Ask(&TactileStub::Tare, request, timeout);
}

Result<v1::ForceLevelState> Client::SetThresholds(const std::string& link, const std::string& region,
                                                  const v1::Thresholds& thresholds, milliseconds timeout) {
  v1::SetThresholdsRequest request;
  request.set_link(link);
  request.set_region(region);
  *request.mutable_thresholds() = thresholds;
  auto response = connection_->Ask(&TactileStub::SetThresholds, request, timeout);
  if (!response) return response.error();
  return std::move(*response->mutable_state());
}

Result<v1::CalibrationResult> Client::Calibrate(const v1::CalibrateRequest& request,
                                                const CalibrateProgress& progress, milliseconds timeout) {
  grpc::ClientContext context;
  context.set_deadline(system_clock::now() + timeout);
  const auto reader = connection_->stub->Calibrate(&context, request);
  v1::CalibrateResponse response;
  std::optional<v1::CalibrationResult> result;
  bool cancelled = false;
  while (reader->Read(&response)) {
    if (response.has_result()) result = std::move(*response.mutable_result());
    if (!response.has_progress() || !progress || cancelled) continue;
    cancelled = !progress(response.progress());
    if (cancelled) context.TryCancel();
  }
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return FromStatus(status, connection_->address);
  if (!result) return Error{ErrorCode::kInternal, "the server ended the calibration without a result"};
  return *std::move(result);
}

Result<std::unique_ptr<FrameReader>> Client::StreamFrames(const v1::StreamFramesRequest& request,
                                                          milliseconds timeout) {
  using Call = FrameReader::Call;
  auto call = std::make_unique<Call>(connection_->address, connection_->channel);
  call->reader = connection_->stub->AsyncStreamFrames(&call->context, request, &call->queue,
                                                      Call::AsPointer(Call::kStart));
  // A stream begins with its status.
  if (const auto accepted = call->ReadFirst(timeout); !accepted) return accepted.error();
  call->TakeStatus();
  return std::unique_ptr<FrameReader>(new FrameReader(std::move(call)));
}

}  // namespace taclink::client

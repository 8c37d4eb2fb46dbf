#include "client/taclink/client.h"

#include <grpcpp/create_channel.h>

#include <atomic>
#include <utility>

#include "client/messages.h"
#include "taclink/v1/tactile.grpc.pb.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

int64_t UtcNowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(system_clock::now().time_since_epoch()).count();
}

Error NoServer(const std::string& address) {
  return {ErrorCode::kUnavailable,
          "no server answers at " + address + "; start taclinkd there or choose another with --server"};
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
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return ErrorCode::kResourceExhausted;
    case grpc::StatusCode::UNIMPLEMENTED:
      return ErrorCode::kUnsupported;
    case grpc::StatusCode::CANCELLED:
      return ErrorCode::kEndOfData;
    default:
      return ErrorCode::kInternal;
  }
}

Error FromStatus(const grpc::Status& status, const std::string& address) {
  const ErrorCode code = CodeOf(status.error_code());
  if (code == ErrorCode::kUnavailable) {
    return {code, "lost the server at " + address + " (" + status.error_message() + "); check that it runs"};
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

}  // namespace

struct Client::Connection {
  std::string address;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::TactileService::Stub> stub;
};

/// One call over its own completion queue, so that Next can wait with a timeout and leave the read under way.
struct FrameReader::Call {
  enum Tag : intptr_t { kStart = 1, kRead, kFinish };
  static void* AsPointer(Tag tag) { return reinterpret_cast<void*>(tag); }

  std::string address;
  std::shared_ptr<grpc::Channel> channel;  // lives as long as the call
  grpc::ClientContext context;
  grpc::CompletionQueue queue;
  std::unique_ptr<grpc::ClientAsyncReader<v1::StreamFramesResponse>> reader;
  v1::StreamFramesResponse response;
  grpc::Status status;
  std::vector<StreamCounts> counts;
  std::string end_reason;
  bool started = false;
  bool reading = false;
  bool finished = false;
  std::atomic<bool> cancelled = false;

  ~Call() {
    context.TryCancel();
    queue.Shutdown();
    void* tag = nullptr;
    bool ok = false;
    while (queue.Next(&tag, &ok)) {
    }
  }

  // Waits for the next message of the stream in `response`.
  Result<void> Read(system_clock::time_point deadline) {
    while (!finished) {
      if (started && !reading) {
        reader->Read(&response, AsPointer(kRead));
        reading = true;
      }
      void* tag = nullptr;
      bool ok = false;
      if (queue.AsyncNext(&tag, &ok, deadline) != grpc::CompletionQueue::GOT_EVENT) {
        return Error{ErrorCode::kTimeout, "no frame in time"};
      }
      started = true;
      if (tag == AsPointer(kFinish)) finished = true;
      if (tag != AsPointer(kRead)) continue;
      if (ok) return reading = false, Result<void>();
      reader->Finish(&status, AsPointer(kFinish));
    }
    return EndError();
  }

  Error EndError() const {
    if (cancelled) return {ErrorCode::kEndOfData, "the stream was cancelled"};
    if (!end_reason.empty()) return {ErrorCode::kUnavailable, "the server ended the stream: " + end_reason};
    return FromStatus(status, address);
  }

  void TakeStatus() {
    counts = FromMessage(response.status());
    end_reason = response.status().end_reason();
  }
};

FrameReader::FrameReader(std::unique_ptr<Call> call) : call_(std::move(call)) {}
FrameReader::~FrameReader() = default;

Result<Frame> FrameReader::Next(milliseconds timeout) {
  const auto deadline = system_clock::now() + timeout;
  while (true) {
    const auto read = call_->Read(deadline);
    if (!read) return read.error();
    if (call_->response.has_status()) call_->TakeStatus();
    if (!call_->response.has_frame()) continue;
    Frame frame = FromMessage(call_->response.frame());
    frame.times.client_utc_ns = UtcNowNs();
    return frame;
  }
}

void FrameReader::Cancel() {
  call_->cancelled = true;
  call_->context.TryCancel();
}

const std::vector<StreamCounts>& FrameReader::counts() const {
  return call_->counts;
}

Client::Client(std::shared_ptr<Connection> connection) : connection_(std::move(connection)) {}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

Result<Client> Client::Connect(const std::string& address, milliseconds timeout) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);  // robots are on the local network
  auto connection = std::make_shared<Connection>();
  connection->address = address;
  connection->channel = grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
  if (!connection->channel->WaitForConnected(system_clock::now() + timeout)) return NoServer(address);
  connection->stub = v1::TactileService::NewStub(connection->channel);
  return Client(std::move(connection));
}

Result<Arm> Client::GetArm(milliseconds timeout) {
  grpc::ClientContext context;
  context.set_deadline(system_clock::now() + timeout);
  v1::GetArmResponse response;
  const grpc::Status status = connection_->stub->GetArm(&context, {}, &response);
  if (!status.ok()) return FromStatus(status, connection_->address);
  return FromMessage(response.arm());
}

Result<CalibrationResult> Client::Calibrate(const CalibrateOptions& options,
                                            const CalibrateProgress& progress, milliseconds timeout) {
  grpc::ClientContext context;
  context.set_deadline(system_clock::now() + timeout);
  const auto reader = connection_->stub->Calibrate(&context, ToMessage(options));
  v1::CalibrateResponse response;
  std::optional<CalibrationResult> result;
  bool cancelled = false;
  while (reader->Read(&response)) {
    if (response.has_result()) result = FromMessage(response.result());
    if (!response.has_progress() || !progress || cancelled) continue;
    const auto& counts = response.progress();
    cancelled = !progress(static_cast<int>(counts.pairs_taken()), static_cast<int>(counts.pairs_wanted()));
    if (cancelled) context.TryCancel();
  }
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return FromStatus(status, connection_->address);
  if (!result) return Error{ErrorCode::kInternal, "the server ended the calibration without a result"};
  return *std::move(result);
}

Result<std::unique_ptr<FrameReader>> Client::StreamFrames(const StreamOptions& options,
                                                          milliseconds timeout) {
  auto call = std::make_unique<FrameReader::Call>();
  call->address = connection_->address;
  call->channel = connection_->channel;
  call->reader =
      connection_->stub->AsyncStreamFrames(&call->context, ToMessage(options), &call->queue,
                                           FrameReader::Call::AsPointer(FrameReader::Call::kStart));
  const auto accepted = call->Read(system_clock::now() + timeout);  // a stream begins with its status
  if (!accepted) {
    if (accepted.error().code != ErrorCode::kTimeout) return accepted.error();
    return Error{ErrorCode::kTimeout,
                 "the server at " + connection_->address + " did not answer in time; try again"};
  }
  call->TakeStatus();
  return std::unique_ptr<FrameReader>(new FrameReader(std::move(call)));
}

}  // namespace taclink::client

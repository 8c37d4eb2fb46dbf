#include "client/cpp/taclink/arm_contacts.h"

#include <utility>

#include "client/cpp/stream_call.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

}  // namespace

struct ContactReader::Call : StreamCall<v1::StreamContactsResponse> {
  using StreamCall::StreamCall;
  bool first_waits = true;  // the one that was read to see the server accept
};

ContactReader::ContactReader(std::unique_ptr<Call> call) : call_(std::move(call)) {}
ContactReader::~ContactReader() = default;

Result<v1::StreamContactsResponse> ContactReader::Next(milliseconds timeout) {
  if (!std::exchange(call_->first_waits, false)) {
    const auto read = call_->Read(system_clock::now() + timeout);
    if (!read) return read.error();
  }
  return std::move(call_->response);
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
  v1::UpdateJointStatesResponse response;
  std::unique_ptr<grpc::ClientWriter<v1::UpdateJointStatesRequest>> writer;
  bool finished = false;

  ~Call() {
    if (!finished && writer) {
      context.TryCancel();
      static_cast<void>(writer->Finish());
    }
  }

  Result<v1::UpdateJointStatesResponse> Finish() {
    finished = true;
    const grpc::Status status = writer->Finish();
    if (!status.ok()) return FromStatus(status, connection->address);
    return response;
  }
};

JointStateWriter::JointStateWriter(std::unique_ptr<Call> call) : call_(std::move(call)) {}
JointStateWriter::~JointStateWriter() = default;

Result<void> JointStateWriter::Write(const v1::UpdateJointStatesRequest& states) {
  if (call_->finished) return Error{ErrorCode::kFailedPrecondition, "the call has ended"};
  if (call_->writer->Write(states)) return {};
  const auto end = call_->Finish();
  return end ? Error{ErrorCode::kUnavailable, "the server ended the call early"} : end.error();
}

Result<v1::UpdateJointStatesResponse> JointStateWriter::Finish() {
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

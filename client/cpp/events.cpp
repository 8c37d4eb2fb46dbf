#include "client/cpp/taclink/events.h"

#include <utility>

#include "client/cpp/connection.h"
#include "client/cpp/stream_call.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

}  // namespace

struct EventReader::Call : StreamCall<v1::StreamEventsResponse> {
  using StreamCall::StreamCall;

  void TakeStatus() {
    status = response.status();
    end_reason = status.end_reason();
  }

  v1::EventStreamStatus status;
};

EventReader::EventReader(std::unique_ptr<Call> call) : call_(std::move(call)) {}
EventReader::~EventReader() = default;

Result<v1::Event> EventReader::Next(milliseconds timeout) {
  const auto deadline = system_clock::now() + timeout;
  while (true) {
    const auto read = call_->Read(deadline);
    if (!read) return read.error();
    if (call_->response.has_status()) call_->TakeStatus();
    if (!call_->response.has_event()) continue;
    call_->status.set_position(call_->response.event().sequence());
    return std::move(*call_->response.mutable_event());
  }
}

void EventReader::Cancel() {
  call_->Cancel();
}

const v1::EventStreamStatus& EventReader::status() const {
  return call_->status;
}

Result<std::unique_ptr<EventReader>> Client::StreamEvents(const v1::StreamEventsRequest& request,
                                                          milliseconds timeout) {
  using Call = EventReader::Call;
  auto call = std::make_unique<Call>(connection_->address, connection_->channel);
  call->reader = connection_->stub->AsyncStreamEvents(&call->context, request, &call->queue,
                                                      Call::AsPointer(Call::kStart));
  // A stream begins with its status.
  if (const auto accepted = call->ReadFirst(timeout); !accepted) return accepted.error();
  call->TakeStatus();
  return std::unique_ptr<EventReader>(new EventReader(std::move(call)));
}

}  // namespace taclink::client

#include "client/cpp/taclink/events.h"

#include <utility>

#include "client/cpp/connection.h"
#include "client/cpp/messages.h"
#include "client/cpp/stream_call.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

}  // namespace

struct EventReader::Call : StreamCall<v1::StreamEventsResponse> {
  using StreamCall::StreamCall;

  void TakeStatus() {
    const v1::EventStreamStatus& message = response.status();
    place = {message.run_id(), message.position()};
    lost = message.events_lost();
    newest = message.newest_sequence();
    run_changed = message.run_changed();
    end_reason = message.end_reason();
  }

  EventPlace place;
  uint64_t lost = 0, newest = 0;
  bool run_changed = false;
};

EventReader::EventReader(std::unique_ptr<Call> call) : call_(std::move(call)) {}
EventReader::~EventReader() = default;

Result<Event> EventReader::Next(milliseconds timeout) {
  const auto deadline = system_clock::now() + timeout;
  while (true) {
    const auto read = call_->Read(deadline);
    if (!read) return read.error();
    if (call_->response.has_status()) call_->TakeStatus();
    if (!call_->response.has_event()) continue;
    Event event = FromMessage(call_->response.event());
    event.client_utc_ns =
        std::chrono::duration_cast<std::chrono::nanoseconds>(system_clock::now().time_since_epoch()).count();
    call_->place.after_sequence = event.sequence;
    return event;
  }
}

void EventReader::Cancel() {
  call_->Cancel();
}

const EventPlace& EventReader::place() const {
  return call_->place;
}
uint64_t EventReader::events_lost() const {
  return call_->lost;
}
bool EventReader::run_changed() const {
  return call_->run_changed;
}
uint64_t EventReader::newest_sequence() const {
  return call_->newest;
}

Result<std::unique_ptr<EventReader>> Client::StreamEvents(const EventOptions& options, milliseconds timeout) {
  using Call = EventReader::Call;
  auto call = std::make_unique<Call>(connection_->address, connection_->channel);
  call->reader = connection_->stub->AsyncStreamEvents(&call->context, ToMessage(options), &call->queue,
                                                      Call::AsPointer(Call::kStart));
  // A stream begins with its status.
  if (const auto accepted = call->ReadFirst(timeout); !accepted) return accepted.error();
  call->TakeStatus();
  return std::unique_ptr<EventReader>(new EventReader(std::move(call)));
}

Result<std::vector<LinkTare>> Client::Tare(const TareRequest& request, milliseconds timeout) {
  grpc::ClientContext context;
  context.set_deadline(system_clock::now() + timeout);
  v1::TareResponse response;
  const grpc::Status status = connection_->stub->Tare(&context, ToMessage(request), &response);
  if (!status.ok()) return FromStatus(status, connection_->address);
  std::vector<LinkTare> links;
  for (const auto& link : response.links()) links.push_back(FromMessage(link));
  return links;
}

Result<ForceLevelState> Client::SetThresholds(const std::string& link, const std::string& region,
                                              const Thresholds& thresholds, milliseconds timeout) {
  grpc::ClientContext context;
  context.set_deadline(system_clock::now() + timeout);
  v1::SetThresholdsRequest request;
  request.set_link(link);
  request.set_region(region);
  *request.mutable_thresholds() = ToMessage(thresholds);
  v1::SetThresholdsResponse response;
  const grpc::Status status = connection_->stub->SetThresholds(&context, request, &response);
  if (!status.ok()) return FromStatus(status, connection_->address);
  return FromMessage(response.state());
}

}  // namespace taclink::client

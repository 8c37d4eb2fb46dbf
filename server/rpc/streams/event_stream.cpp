#include "server/rpc/streams/event_stream.h"

#include <utility>

#include "server/messages/event_message.h"

namespace taclink::server {
namespace {

grpc::ByteBuffer Bytes(const v1::StreamEventsResponse& response) {
  const grpc::Slice slice(response.SerializeAsString());
  return {&slice, 1};
}

}  // namespace

Result<EventStart> FindStart(const EventHistory& history, std::optional<uint64_t> after_sequence,
                             const std::string& run_id) {
  if (!after_sequence) return EventStart{.after = history.newest()};
  const bool this_run = run_id == history.run_id() || (run_id.empty() && *after_sequence == 0);
  if (!this_run) {
    if (run_id.empty())
      return Error{ErrorCode::kInvalidArgument, "after_sequence needs the run_id that it belongs to"};
    return EventStart{.after = 0, .run_changed = true};
  }
  if (*after_sequence > history.newest())
    return Error{ErrorCode::kInvalidArgument, "after_sequence " + std::to_string(*after_sequence) +
                                                  " has not happened; the newest event is " +
                                                  std::to_string(history.newest())};
  return EventStart{.after = *after_sequence};
}

EventStream::EventStream(std::vector<std::string> link_names, Clock& clock, StreamRegistry& registry,
                         std::shared_ptr<boost::asio::thread_pool> senders)
    : PumpedStream(registry, std::move(senders), Urgency::kUrgent),
      link_names_(std::move(link_names)),
      clock_(clock) {}

void EventStream::Begin(EventHistory& history, const EventStart& start, EventFilter filter) {
  history_ = &history;
  run_changed_ = start.run_changed;
  cursor_ = std::make_unique<EventCursor>(history, start.after, std::move(filter), Notifier());
  Open();
}

std::optional<grpc::ByteBuffer> EventStream::Next() {
  if (!status_sent_) {
    cursor_->CatchUp();
    status_sent_ = true;
    return Status("");
  }
  const EventCursor::Step step = cursor_->Next();
  if (step.status) return Status("");
  if (!step.event) return std::nullopt;
  v1::StreamEventsResponse response;
  const Event& event = *step.event;
  Fill(event, event.link ? link_names_[*event.link] : std::string(), *response.mutable_event());
  response.mutable_event()->mutable_times()->set_sent_utc_ns(clock_.UtcNs());
  return Bytes(response);
}

std::optional<grpc::ByteBuffer> EventStream::Last(const std::string& reason) {
  return Status(reason);
}

grpc::ByteBuffer EventStream::Status(const std::string& end_reason) {
  v1::StreamEventsResponse response;
  v1::EventStreamStatus& status = *response.mutable_status();
  status.set_run_id(history_->run_id());
  status.set_newest_sequence(history_->newest());
  status.set_position(cursor_->position());
  status.set_events_lost(cursor_->lost());
  status.set_run_changed(run_changed_);
  status.set_history_capacity(static_cast<uint32_t>(history_->capacity()));
  status.set_end_reason(end_reason);
  return Bytes(response);
}

}  // namespace taclink::server

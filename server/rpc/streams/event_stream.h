#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/clock.h"
#include "server/events/event_history.h"
#include "server/rpc/streams/pumped_stream.h"

namespace taclink::server {

/// Where a client's stream of events begins.
struct EventStart {
  uint64_t after = 0;
  bool run_changed = false;
};
/// `after_sequence` none: now. Errors: kInvalidArgument (a number that this run has not reached).
Result<EventStart> FindStart(const EventHistory& history, std::optional<uint64_t> after_sequence,
                             const std::string& run_id);

/// One client's StreamEvents call: its place in the history, and how many it missed.
class EventStream final : public PumpedStream {
 public:
  /// `link_names` by link.
  EventStream(std::vector<std::string> link_names, Clock& clock, StreamRegistry& registry,
              std::shared_ptr<boost::asio::thread_pool> senders);

  /// Begins to send. Only once the registry holds the stream.
  void Begin(EventHistory& history, const EventStart& start, EventFilter filter);

 private:
  std::optional<grpc::ByteBuffer> Next() override;
  std::optional<grpc::ByteBuffer> Last(const std::string& reason) override;
  grpc::ByteBuffer Status(const std::string& end_reason);

  // Constant after construction.
  const std::vector<std::string> link_names_;
  Clock& clock_;
  // Set by Begin.
  EventHistory* history_ = nullptr;
  std::unique_ptr<EventCursor> cursor_;
  bool run_changed_ = false;

  // Used by one thread at a time.
  bool status_sent_ = false;
};

}  // namespace taclink::server

#pragma once

#include <chrono>
#include <memory>

#include "taclink/result.h"
#include "taclink/v1/events.pb.h"

namespace taclink::client {

/// A running stream of events; it ends when destroyed. Call Next and status from one thread, Cancel from any.
class EventReader {
 public:
  ~EventReader();
  EventReader(const EventReader&) = delete;
  EventReader& operator=(const EventReader&) = delete;

  /// Waits for the next event. Errors: kTimeout (call again), kEndOfData (cancelled), kUnavailable (the
  /// server ended the stream or is gone: connect again and resume, see `status`).
  Result<v1::Event> Next(std::chrono::milliseconds timeout);
  /// Next returns kEndOfData, also one that waits now.
  void Cancel();

  /// The newest status of the server, which comes once a second, with `position` advanced by each event that
  /// Next has returned. To resume, copy `run_id` and `position` to StreamEventsRequest.run_id and
  /// after_sequence.
  const v1::EventStreamStatus& status() const;

 private:
  friend class Client;
  struct Call;
  explicit EventReader(std::unique_ptr<Call> call);

  std::unique_ptr<Call> call_;
};

using EventKind [[deprecated("use taclink::v1::EventKind")]] = v1::EventKind;
using Event [[deprecated("use taclink::v1::Event")]] = v1::Event;
using ForceLevel [[deprecated("use taclink::v1::ForceLevel")]] = v1::ForceLevel;
using ForceLevelState [[deprecated("use taclink::v1::ForceLevelState")]] = v1::ForceLevelState;
using Thresholds [[deprecated("use taclink::v1::Thresholds")]] = v1::Thresholds;

}  // namespace taclink::client

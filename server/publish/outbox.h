#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>

namespace taclink::server {

struct OutMessage {
  std::string subject;
  std::string id;  ///< unique; the same when it is sent again, so that the receiver keeps one
  std::shared_ptr<const std::string> bytes;
  std::string tail = {};  ///< follows `bytes`
  bool frame = false;     ///< gives way when there is no room

  /// Memory that it costs to keep it.
  size_t size() const { return sizeof *this + bytes->size() + tail.size() + subject.size() + 2 * id.size(); }
};

struct OutboxCounts {
  uint64_t acknowledged = 0;
  uint64_t sent_again = 0;
  uint64_t frames_dropped = 0;
  uint64_t others_dropped = 0;  ///< events and contacts: only where they alone need more than the room
  size_t waiting = 0, in_flight = 0;
  size_t bytes = 0;  ///< memory of both
};

/// What waits to be sent, or was sent and is not acknowledged. Bounded in bytes: the oldest frames give way
/// first, then the oldest of the others. One thread at a time.
class Outbox {
 public:
  explicit Outbox(size_t most_bytes) : most_bytes_(most_bytes) {}

  void Push(OutMessage message);
  /// The oldest that waits; it is in flight from now on, and stays here. Null: none waits.
  const OutMessage* Next();
  void Acknowledge(const std::string& id);
  /// Was not taken: waits again, in its old place.
  void Return(const std::string& id);
  /// All that is in flight waits again.
  void ReturnAll();

  OutboxCounts counts() const;
  size_t in_flight() const { return in_flight_.size(); }

 private:
  using Waiting = std::map<uint64_t, OutMessage>;  // by the order in which they came
  struct Sent {
    uint64_t order = 0;
    OutMessage message;
  };

  Waiting& QueueOf(const OutMessage& message) { return message.frame ? frames_ : others_; }
  void MakeRoom();
  bool DropOldest(Waiting& queue, uint64_t& count);

  const size_t most_bytes_;
  uint64_t next_order_ = 0;
  Waiting frames_, others_;
  std::unordered_map<std::string, Sent> in_flight_;  // by id
  OutboxCounts counts_;
};

}  // namespace taclink::server

#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"
#include "server/hub/byte_budget.h"
#include "server/hub/deadband.h"
#include "wire/detail.h"

namespace taclink::server {

/// Makes the bytes of a state of link `link` at a level of detail. Called by several threads at a time.
using FrameEncoder = std::function<std::string(size_t link, const LinkState& state, Detail detail)>;

/// Makes a link's bytes and remembers how many they were.
class LinkEncoder {
 public:
  LinkEncoder(size_t link, const FrameEncoder& encoder) : link_(link), encoder_(encoder) {}

  size_t link() const { return link_; }
  std::shared_ptr<const std::string> Encode(const LinkState& state, Detail detail);
  /// Of the newest encoding at this level, bytes; 0: none yet.
  size_t bytes(Detail detail) const { return bytes_[Index(detail)].load(std::memory_order_relaxed); }

 private:
  const size_t link_;
  const FrameEncoder& encoder_;
  std::array<std::atomic<size_t>, kDetailCount> bytes_{};
};

/// One published state, shared by all who want it.
class Publication {
 public:
  /// `encoder` outlives it.
  Publication(uint64_t order, std::shared_ptr<const LinkState> state, LinkEncoder& encoder);

  size_t link() const { return encoder_.link(); }
  uint64_t order() const { return order_; }  ///< rises from publication to publication of the hub
  const LinkState& state() const { return *state_; }
  const std::shared_ptr<const LinkState>& shared_state() const { return state_; }
  /// Encoded by the first who asks, once for each level of detail.
  std::shared_ptr<const std::string> Encoded(Detail detail) const;
  /// Memory that it costs to let it wait for somebody who reads at `detail`, bytes: the state's and that of
  /// the encoding, as large as the link's newest one at this level.
  size_t Cost(Detail detail) const { return state_bytes_ + encoder_.bytes(detail); }

 private:
  // Constant after construction.
  const uint64_t order_;
  const std::shared_ptr<const LinkState> state_;
  const size_t state_bytes_;
  LinkEncoder& encoder_;
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  mutable std::array<std::shared_ptr<const std::string>, kDetailCount> encoded_;
};
using PublicationPtr = std::shared_ptr<const Publication>;
/// What a state was made of; kept only for those who want it.
struct FramePictures {
  RawPictures raw;
  LabelledMarkers labels;  ///< found in them; empty where nothing was measured
};
using PicturesPtr = std::shared_ptr<const FramePictures>;

/// What happens to states that a subscriber is too slow for.
enum class Delivery : uint8_t {
  kLatest,  ///< only the newest of each link waits
  kEvery,   ///< all wait in order; when the queue is full the oldest falls out, so that what is left is one
            ///< piece
};

struct SubscriberOptions {
  std::vector<bool> links = {};  ///< by link: wanted; empty: all
  Delivery delivery = Delivery::kLatest;
  double max_rate_hz = 0;       ///< of each link; 0: all
  size_t queue_capacity = 256;  ///< with kEvery, states of all links together
  /// With kEvery: what waits costs no more (Publication::Cost), but for the newest state, which always waits.
  size_t queue_bytes = size_t{32} << 20;
  /// Likewise what waits for all subscribers that share it; null: shared with nobody.
  std::shared_ptr<ByteBudget> party_bytes = {};
  Detail detail = Detail::kContacts;  ///< that the subscriber will read at, for the cost
  Deadband deadband = {};
  bool pictures = false;  ///< also what the states were made of; counts in the cost
};

struct DeliveryCounts {
  uint64_t taken = 0;
  uint64_t dropped = 0;            ///< wanted, but replaced or pushed out before they were taken
  uint64_t dropped_for_bytes = 0;  ///< of these, pushed out because of queue_bytes or party_bytes
  uint64_t unchanged = 0;          ///< left out because of the deadband
};

class SubscriberQueue;

/// A place in the hub's list of receivers; leaves the list when it is destroyed. Take from one thread at a
/// time.
class Subscription {
 public:
  explicit Subscription(std::shared_ptr<SubscriberQueue> queue) : queue_(std::move(queue)) {}
  ~Subscription();
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;

  /// The next state, at once. Null: there is none, and the next one to come will be notified. `unchanged` is
  /// set to whether it is within the deadband about the newest one of its link that was taken before and was
  /// not; `pictures` to what it was made of (null: not asked for, or there is nothing).
  PublicationPtr Take(bool* unchanged = nullptr, PicturesPtr* pictures = nullptr);
  std::vector<DeliveryCounts> Counts() const;  ///< by link
  uint64_t dropped() const;                    ///< of all links
  size_t waiting() const;
  size_t waiting_bytes() const;  ///< what the waiting ones cost
  size_t capacity() const;

 private:
  const std::shared_ptr<SubscriberQueue> queue_;
};

/// Of all subscribers.
struct HubTotals {
  size_t subscribers = 0;
  size_t waiting = 0;    ///< states in their queues
  uint64_t dropped = 0;  ///< also of those that have left; never falls
};

/// Hands every link's states to all subscribers. A publisher never waits for a subscriber: what a slow one
/// can't take is dropped and counted. Memory is bounded by the subscribers' queues.
class Hub {
 public:
  Hub(size_t links, FrameEncoder encoder);
  ~Hub();

  /// Called by one thread for each link; different links at any time.
  void Publish(size_t link, std::shared_ptr<const LinkState> state, const PicturesPtr& pictures = nullptr);
  /// Whether any subscriber wants a link's pictures. Any thread.
  bool WantsPictures(size_t link) const { return *picture_readers_[link] > 0; }

  /// `notify` is called, by a publisher and outside any lock, when a state arrives after Take found none; it
  /// must be quick and must not throw. One call may still be under way when the subscription is destroyed, so
  /// it may hold only what outlives that. kLatest begins with the newest state of each link. The hub must
  /// outlive the subscription.
  std::unique_ptr<Subscription> Subscribe(SubscriberOptions options, std::function<void()> notify);

  /// The newest state of a link; null: none yet.
  PublicationPtr Latest(size_t link) const;
  HubTotals Totals() const;
  size_t links() const { return links_.size(); }

 private:
  using Queues = std::vector<std::weak_ptr<SubscriberQueue>>;

  // Constant after construction.
  const FrameEncoder encoder_;
  std::vector<std::unique_ptr<LinkEncoder>> links_;                 // by link
  std::vector<std::shared_ptr<std::atomic<int>>> picture_readers_;  // by link
  const std::shared_ptr<std::atomic<uint64_t>> dropped_before_ =
      std::make_shared<std::atomic<uint64_t>>(0);  // by subscribers that have left
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<PublicationPtr> latest_;    // by link
  std::shared_ptr<const Queues> queues_;  // replaced as a whole, so that publishers iterate without the lock
  uint64_t next_order_ = 0;
  mutable uint64_t dropped_told_ = 0;  // by Totals
};

}  // namespace taclink::server

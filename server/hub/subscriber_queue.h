#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "server/hub/hub.h"
#include "server/hub/rate_limit.h"

namespace taclink::server {

/// What waits for one subscriber. Bounded in number and in bytes.
class SubscriberQueue {
 public:
  SubscriberQueue(size_t links, SubscriberOptions options, std::function<void()> notify);
  ~SubscriberQueue();
  SubscriberQueue(const SubscriberQueue&) = delete;
  SubscriberQueue& operator=(const SubscriberQueue&) = delete;

  /// True: the subscriber waits and is to be notified.
  bool Offer(const PublicationPtr& publication, const PicturesPtr& pictures);
  PublicationPtr Take(bool* unchanged, PicturesPtr* pictures);
  void Notify() const { notify_(); }
  void Close() { closed_ = true; }
  bool closed() const { return closed_; }

  std::vector<DeliveryCounts> Counts() const;
  uint64_t dropped() const { return dropped_; }
  size_t waiting() const;
  size_t waiting_bytes() const;
  size_t capacity() const { return ring_.size(); }

 private:
  struct PerLink {
    bool wanted = true;
    RateLimit rate{0};  // of published_ns
    DeliveryCounts counts;
    // Of the deadband.
    std::shared_ptr<const LinkState> reference;  // the newest that changed; all that follow are like it
    int64_t accepted_ns = 0;                     // the newest that was let in, in published_ns
  };
  struct Place {
    PublicationPtr publication;
    PicturesPtr pictures;
    size_t cost = 0;         // bytes
    bool unchanged = false;  // within the deadband
  };

  enum class News { kNone, kUnchanged, kChanged };
  News Judge(PerLink& link, const LinkState& state) const;
  Place PopFirst();
  void Release(size_t bytes);
  void Drop(const Place& place, bool for_bytes, Place& incoming);
  void ReferTo(const Place& dropped, Place& next);
  void PushEvery(Place place, std::vector<Place>& fallen);
  void PushLatest(Place place, Place& replaced);
  Place& At(size_t place) { return ring_[(first_ + place) % ring_.size()]; }

  // Constant after construction.
  const Delivery delivery_;
  const size_t most_bytes_;
  const std::shared_ptr<ByteBudget> party_bytes_;
  const Detail detail_;
  const Deadband deadband_;
  const bool pictures_;
  const std::function<void()> notify_;

  std::atomic<bool> closed_ = false;
  std::atomic<uint64_t> dropped_ = 0;
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<PerLink> links_;
  std::vector<Place> ring_;  // count_ of them from first_ on, oldest first
  size_t first_ = 0;
  size_t count_ = 0;
  size_t bytes_ = 0;    // cost of all places, taken from party_bytes_
  bool armed_ = false;  // Take found nothing since the last notification
};

}  // namespace taclink::server

#pragma once

#include <atomic>
#include <functional>
#include <limits>
#include <mutex>
#include <vector>

#include "server/hub.h"

namespace taclink::server {

/// What waits for one subscriber. Its size is fixed at construction.
class SubscriberQueue {
 public:
  SubscriberQueue(size_t links, SubscriberOptions options, std::function<void()> notify);

  /// True: the subscriber waits and is to be notified.
  bool Offer(const PublicationPtr& publication);
  PublicationPtr Take();
  void Notify() const { notify_(); }
  void Close() { closed_ = true; }
  bool closed() const { return closed_; }

  std::vector<DeliveryCounts> Counts() const;
  uint64_t dropped() const { return dropped_; }
  size_t waiting() const;
  size_t capacity() const { return ring_.size(); }

 private:
  struct PerLink {
    bool wanted = true;
    int64_t next_due_ns = std::numeric_limits<int64_t>::min() / 2;  // of the rate limit, in published_ns
    DeliveryCounts counts;
  };

  void CountDrop(size_t link);
  bool Due(PerLink& link, int64_t published_ns) const;
  void PushEvery(PublicationPtr& publication);
  void PushLatest(PublicationPtr& publication);
  PublicationPtr& At(size_t place) { return ring_[(first_ + place) % ring_.size()]; }

  // Constant after construction.
  const Delivery delivery_;
  const int64_t period_ns_;  // of the rate limit; 0: none
  const std::function<void()> notify_;

  std::atomic<bool> closed_ = false;
  std::atomic<uint64_t> dropped_ = 0;
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<PerLink> links_;
  std::vector<PublicationPtr> ring_;  // count_ of them from first_ on, oldest first
  size_t first_ = 0;
  size_t count_ = 0;
  bool armed_ = false;  // Take found nothing since the last notification
};

}  // namespace taclink::server

#include "server/subscriber_queue.h"

#include <algorithm>
#include <utility>

namespace taclink::server {
namespace {

// How early a frame may come and still count, for cameras are not exactly regular: a part of the period, and
// at most.
constexpr int64_t kEarlyDivisor = 4;
constexpr int64_t kEarlyMaxNs = 10'000'000;
constexpr double kLongestPeriodNs = 1e15;  // any client may ask for any rate

size_t Capacity(size_t links, const SubscriberOptions& options) {
  return options.delivery == Delivery::kLatest ? links : std::max<size_t>(options.queue_capacity, 1);
}

}  // namespace

SubscriberQueue::SubscriberQueue(size_t links, SubscriberOptions options, std::function<void()> notify)
    : delivery_(options.delivery),
      period_ns_(options.max_rate_hz > 0
                     ? static_cast<int64_t>(std::min(1e9 / options.max_rate_hz, kLongestPeriodNs))
                     : 0),
      notify_(std::move(notify)),
      links_(links),
      ring_(Capacity(links, options)) {
  for (size_t i = 0; i < links && i < options.links.size(); ++i) links_[i].wanted = options.links[i];
}

// The schedule goes on from its own last date, so that frames that come a little early or late do not lower
// the rate in the long run.
bool SubscriberQueue::Due(PerLink& link, int64_t published_ns) const {
  if (period_ns_ == 0) return true;
  if (published_ns < link.next_due_ns - std::min(period_ns_ / kEarlyDivisor, kEarlyMaxNs)) return false;
  link.next_due_ns += period_ns_;
  if (link.next_due_ns <= published_ns) link.next_due_ns = published_ns + period_ns_;
  return true;
}

bool SubscriberQueue::Offer(const PublicationPtr& publication) {
  PublicationPtr moving = publication;  // holds what falls out, to be released after the lock
  const std::lock_guard lock(mutex_);
  PerLink& link = links_[publication->link()];
  if (!link.wanted || !Due(link, publication->state().times.published_ns)) return false;
  if (delivery_ == Delivery::kEvery) {
    PushEvery(moving);
  } else {
    PushLatest(moving);
  }
  return std::exchange(armed_, false);
}

void SubscriberQueue::CountDrop(size_t link) {
  ++links_[link].counts.dropped;
  ++dropped_;
}

void SubscriberQueue::PushEvery(PublicationPtr& publication) {
  if (count_ < ring_.size()) {
    std::swap(At(count_++), publication);
    return;
  }
  std::swap(At(0), publication);
  first_ = (first_ + 1) % ring_.size();
  CountDrop(publication->link());
}

// The newest takes the place of the older one, so that a fast link can't push a slow one back.
void SubscriberQueue::PushLatest(PublicationPtr& publication) {
  for (size_t place = 0; place < count_; ++place) {
    if (At(place)->link() != publication->link()) continue;
    CountDrop(publication->link());
    std::swap(At(place), publication);
    return;
  }
  std::swap(At(count_++), publication);
}

PublicationPtr SubscriberQueue::Take() {
  const std::lock_guard lock(mutex_);
  if (count_ == 0) {
    armed_ = true;
    return nullptr;
  }
  PublicationPtr next = std::move(At(0));
  first_ = (first_ + 1) % ring_.size();
  --count_;
  ++links_[next->link()].counts.taken;
  return next;
}

std::vector<DeliveryCounts> SubscriberQueue::Counts() const {
  const std::lock_guard lock(mutex_);
  std::vector<DeliveryCounts> counts;
  for (const PerLink& link : links_) counts.push_back(link.counts);
  return counts;
}

size_t SubscriberQueue::waiting() const {
  const std::lock_guard lock(mutex_);
  return count_;
}

}  // namespace taclink::server

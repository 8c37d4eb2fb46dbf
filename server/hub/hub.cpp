#include "server/hub/hub.h"

#include <algorithm>
#include <utility>

#include "server/hub/state_bytes.h"
#include "server/hub/subscriber_queue.h"

namespace taclink::server {

std::shared_ptr<const std::string> LinkEncoder::Encode(const LinkState& state, Detail detail) {
  auto encoded = std::make_shared<const std::string>(encoder_(link_, state, detail));
  bytes_[Index(detail)].store(encoded->capacity(), std::memory_order_relaxed);
  return encoded;
}

Publication::Publication(uint64_t order, std::shared_ptr<const LinkState> state, LinkEncoder& encoder)
    : order_(order), state_(std::move(state)), state_bytes_(StateBytes(*state_)), encoder_(encoder) {}

std::shared_ptr<const std::string> Publication::Encoded(Detail detail) const {
  const std::lock_guard lock(mutex_);
  auto& encoded = encoded_[Index(detail)];
  if (!encoded) encoded = encoder_.Encode(*state_, detail);
  return encoded;
}

Subscription::~Subscription() {
  queue_->Close();
}

PublicationPtr Subscription::Take(bool* unchanged, PicturesPtr* pictures) {
  return queue_->Take(unchanged, pictures);
}

std::vector<DeliveryCounts> Subscription::Counts() const {
  return queue_->Counts();
}

uint64_t Subscription::dropped() const {
  return queue_->dropped();
}

size_t Subscription::waiting() const {
  return queue_->waiting();
}

size_t Subscription::waiting_bytes() const {
  return queue_->waiting_bytes();
}

size_t Subscription::capacity() const {
  return queue_->capacity();
}

Hub::Hub(size_t links, FrameEncoder encoder)
    : encoder_(std::move(encoder)), latest_(links), queues_(std::make_shared<const Queues>()) {
  for (size_t link = 0; link < links; ++link) {
    links_.push_back(std::make_unique<LinkEncoder>(link, encoder_));
    picture_readers_.push_back(std::make_shared<std::atomic<int>>(0));
  }
}

Hub::~Hub() = default;

void Hub::Publish(size_t link, std::shared_ptr<const LinkState> state, const PicturesPtr& pictures) {
  std::shared_ptr<const Queues> queues;
  PublicationPtr publication, previous;
  {
    const std::lock_guard lock(mutex_);
    publication = std::make_shared<const Publication>(next_order_++, std::move(state), *links_[link]);
    previous = std::exchange(latest_[link], publication);
    queues = queues_;
  }
  for (const auto& weak : *queues) {
    const auto queue = weak.lock();
    if (queue && !queue->closed() && queue->Offer(publication, pictures)) queue->Notify();
  }
}

std::unique_ptr<Subscription> Hub::Subscribe(SubscriberOptions options, std::function<void()> notify) {
  const Delivery delivery = options.delivery;
  std::vector<std::shared_ptr<std::atomic<int>>> reads;
  for (size_t link = 0; options.pictures && link < links_.size(); ++link) {
    if (link < options.links.size() && !options.links[link]) continue;
    reads.push_back(picture_readers_[link]);
    ++*picture_readers_[link];
  }
  const std::shared_ptr<SubscriberQueue> queue(
      new SubscriberQueue(links_.size(), std::move(options), std::move(notify)),
      [before = dropped_before_, reads = std::move(reads)](SubscriberQueue* leaving) {
        *before += leaving->dropped();
        for (const auto& readers : reads) --*readers;
        delete leaving;
      });
  const std::lock_guard lock(mutex_);
  if (delivery == Delivery::kLatest) {
    for (const auto& latest : latest_) {
      if (latest) queue->Offer(latest, nullptr);
    }
  }
  auto queues = std::make_shared<Queues>();
  for (const auto& other : *queues_) {
    if (!other.expired()) queues->push_back(other);  // those that left are forgotten here
  }
  queues->push_back(queue);
  queues_ = std::move(queues);
  return std::make_unique<Subscription>(queue);
}

HubTotals Hub::Totals() const {
  const std::lock_guard lock(mutex_);
  HubTotals out;
  uint64_t dropped = 0;
  for (const auto& weak : *queues_) {
    const auto queue = weak.lock();
    if (!queue || queue->closed()) continue;
    ++out.subscribers;
    out.waiting += queue->waiting();
    dropped += queue->dropped();
  }
  // One that leaves just now is counted in neither.
  dropped_told_ = std::max(dropped_told_, dropped + *dropped_before_);
  out.dropped = dropped_told_;
  return out;
}

PublicationPtr Hub::Latest(size_t link) const {
  const std::lock_guard lock(mutex_);
  return latest_[link];
}

}  // namespace taclink::server

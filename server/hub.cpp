#include "server/hub.h"

#include <utility>

#include "server/subscriber_queue.h"

namespace taclink::server {

std::shared_ptr<const std::string> Publication::Encoded(Detail detail) const {
  const std::lock_guard lock(mutex_);
  auto& encoded = encoded_[Index(detail)];
  if (!encoded) encoded = std::make_shared<const std::string>(encoder_(link_, *state_, detail));
  return encoded;
}

Subscription::~Subscription() {
  queue_->Close();
}

PublicationPtr Subscription::Take() {
  return queue_->Take();
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

size_t Subscription::capacity() const {
  return queue_->capacity();
}

Hub::Hub(size_t links, FrameEncoder encoder)
    : links_(links),
      encoder_(std::move(encoder)),
      latest_(links),
      queues_(std::make_shared<const Queues>()) {}

Hub::~Hub() = default;

void Hub::Publish(size_t link, std::shared_ptr<const LinkState> state) {
  std::shared_ptr<const Queues> queues;
  PublicationPtr publication, previous;
  {
    const std::lock_guard lock(mutex_);
    publication = std::make_shared<const Publication>(link, next_order_++, std::move(state), encoder_);
    previous = std::exchange(latest_[link], publication);
    queues = queues_;
  }
  for (const auto& weak : *queues) {
    const auto queue = weak.lock();
    if (queue && !queue->closed() && queue->Offer(publication)) queue->Notify();
  }
}

std::unique_ptr<Subscription> Hub::Subscribe(SubscriberOptions options, std::function<void()> notify) {
  const Delivery delivery = options.delivery;
  auto queue = std::make_shared<SubscriberQueue>(links_, std::move(options), std::move(notify));
  const std::lock_guard lock(mutex_);
  if (delivery == Delivery::kLatest) {
    for (const auto& latest : latest_) {
      if (latest) queue->Offer(latest);
    }
  }
  auto queues = std::make_shared<Queues>();
  for (const auto& other : *queues_) {
    if (!other.expired()) queues->push_back(other);  // those that left are forgotten here
  }
  queues->push_back(queue);
  queues_ = std::move(queues);
  return std::make_unique<Subscription>(std::move(queue));
}

PublicationPtr Hub::Latest(size_t link) const {
  const std::lock_guard lock(mutex_);
  return latest_[link];
}

}  // namespace taclink::server

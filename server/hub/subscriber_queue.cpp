#include "server/hub/subscriber_queue.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace taclink::server {
namespace {

size_t Capacity(size_t links, const SubscriberOptions& options) {
  return options.delivery == Delivery::kLatest ? links : std::max<size_t>(options.queue_capacity, 1);
}

size_t Bytes(const FramePictures& pictures) {
  size_t bytes = sizeof pictures;
  for (const RawImage& image : pictures.raw) bytes += image.bytes.capacity();
  for (const auto& camera : pictures.labels.cameras) bytes += camera.capacity() * sizeof(MarkerObservation);
  return bytes;
}

}  // namespace

SubscriberQueue::SubscriberQueue(size_t links, SubscriberOptions options, std::function<void()> notify)
    : delivery_(options.delivery),
      most_bytes_(options.queue_bytes),
      party_bytes_(options.party_bytes ? options.party_bytes
                                       : std::make_shared<ByteBudget>(std::numeric_limits<size_t>::max())),
      detail_(options.detail),
      deadband_(options.deadband),
      pictures_(options.pictures),
      notify_(std::move(notify)),
      links_(links),
      ring_(Capacity(links, options)) {
  for (PerLink& link : links_) link.rate = RateLimit(options.max_rate_hz);
  for (size_t i = 0; i < links && i < options.links.size(); ++i) links_[i].wanted = options.links[i];
}

SubscriberQueue::~SubscriberQueue() {
  party_bytes_->Give(bytes_);
}

void SubscriberQueue::Release(size_t bytes) {
  bytes_ -= bytes;
  party_bytes_->Give(bytes);
}

// A link within its deadband is let in once in a while, so that its silence means something.
SubscriberQueue::News SubscriberQueue::Judge(PerLink& link, const LinkState& state) const {
  if (!deadband_.on() || !link.reference || !Within(deadband_, *link.reference, state)) return News::kChanged;
  const bool due = state.times.published_ns - link.accepted_ns >= kUnchangedPeriodNs;
  return due ? News::kUnchanged : News::kNone;
}

bool SubscriberQueue::Offer(const PublicationPtr& publication, const PicturesPtr& pictures) {
  // What falls out is released after the lock.
  Place replaced;
  std::vector<Place> fallen;
  std::shared_ptr<const LinkState> reference;
  const std::lock_guard lock(mutex_);
  PerLink& link = links_[publication->link()];
  if (!link.wanted) return false;
  const int64_t published_ns = publication->state().times.published_ns;
  const News news = Judge(link, publication->state());
  if (news == News::kNone) {
    ++link.counts.unchanged;
    return false;
  }
  if (!link.rate.Due(published_ns)) return false;
  if (deadband_.on()) {
    if (news == News::kChanged) reference = std::exchange(link.reference, publication->shared_state());
    link.accepted_ns = published_ns;
  }
  Place place{publication, nullptr, publication->Cost(detail_), news == News::kUnchanged};
  if (pictures_ && pictures) {
    place.pictures = pictures;
    place.cost += Bytes(*pictures);
  }
  if (delivery_ == Delivery::kEvery) {
    PushEvery(std::move(place), fallen);
  } else {
    PushLatest(std::move(place), replaced);
  }
  return std::exchange(armed_, false);
}

// `incoming` is about to be let in.
void SubscriberQueue::Drop(const Place& place, bool for_bytes, Place& incoming) {
  const size_t number = place.publication->link();
  PerLink& link = links_[number];
  ++link.counts.dropped;
  link.counts.dropped_for_bytes += for_bytes ? 1 : 0;
  ++dropped_;
  if (!deadband_.on() || place.unchanged) return;
  for (size_t i = 0; i < count_; ++i) {
    if (Place& next = At(i); next.publication && next.publication->link() == number)
      return ReferTo(place, next);
  }
  if (incoming.publication->link() == number) return ReferTo(place, incoming);
  link.reference.reset();
}

// The subscriber never gets `dropped`, so what follows it is not unchanged to it.
void SubscriberQueue::ReferTo(const Place& dropped, Place& next) {
  next.unchanged = false;
  auto& reference = links_[next.publication->link()].reference;
  if (reference == dropped.publication->shared_state()) reference = next.publication->shared_state();
}

SubscriberQueue::Place SubscriberQueue::PopFirst() {
  Place first = std::exchange(At(0), Place{});
  first_ = (first_ + 1) % ring_.size();
  --count_;
  Release(first.cost);
  return first;
}

void SubscriberQueue::PushEvery(Place place, std::vector<Place>& fallen) {
  bool paid = party_bytes_->TryTake(place.cost);
  while (count_ > 0 && (count_ == ring_.size() || bytes_ + place.cost > most_bytes_ || !paid)) {
    const bool for_bytes = count_ < ring_.size();
    Place oldest = PopFirst();
    Drop(oldest, for_bytes, place);
    fallen.push_back(std::move(oldest));
    paid = paid || party_bytes_->TryTake(place.cost);
  }
  if (!paid) party_bytes_->Take(place.cost);  // the newest always waits
  bytes_ += place.cost;
  At(count_++) = std::move(place);
}

// The newest takes the place of the older one, so that a fast link can't push a slow one back.
void SubscriberQueue::PushLatest(Place place, Place& replaced) {
  bytes_ += place.cost;
  party_bytes_->Take(place.cost);
  for (size_t i = 0; i < count_; ++i) {
    Place& older = At(i);
    if (older.publication->link() != place.publication->link()) continue;
    Release(older.cost);
    replaced = std::exchange(older, Place{});
    Drop(replaced, false, place);
    older = std::move(place);
    return;
  }
  At(count_++) = std::move(place);
}

PublicationPtr SubscriberQueue::Take(bool* unchanged, PicturesPtr* pictures) {
  const std::lock_guard lock(mutex_);
  if (count_ == 0) {
    armed_ = true;
    return nullptr;
  }
  Place next = PopFirst();
  ++links_[next.publication->link()].counts.taken;
  if (unchanged) *unchanged = next.unchanged;
  if (pictures) *pictures = std::move(next.pictures);
  return std::move(next.publication);
}

std::vector<DeliveryCounts> SubscriberQueue::Counts() const {
  const std::lock_guard lock(mutex_);
  std::vector<DeliveryCounts> counts;
  for (const PerLink& link : links_) counts.push_back(link.counts);
  return counts;
}

size_t SubscriberQueue::waiting_bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

size_t SubscriberQueue::waiting() const {
  const std::lock_guard lock(mutex_);
  return count_;
}

}  // namespace taclink::server

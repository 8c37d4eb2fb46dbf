#include "server/events/event_history.h"

#include <algorithm>
#include <utility>

namespace taclink::server {

EventHistory::EventHistory(size_t capacity, std::string run_id)
    : run_id_(std::move(run_id)), ring_(std::max<size_t>(capacity, 1)) {}

std::vector<std::function<void()>> EventHistory::TakeWaiting() {
  std::vector<std::function<void()>> waiting;
  for (EventCursor* cursor : cursors_) {
    if (std::exchange(cursor->waiting_, false)) waiting.push_back(cursor->notify_);
  }
  return waiting;
}

void EventHistory::Add(Event event) {
  std::vector<std::function<void()>> waiting;
  {
    const std::lock_guard lock(mutex_);
    event.sequence = ++newest_;
    ring_[newest_ % ring_.size()] = std::make_shared<const Event>(std::move(event));
    waiting = TakeWaiting();
  }
  for (const auto& notify : waiting) notify();
}

void EventHistory::Beat() {
  std::vector<std::function<void()>> waiting;
  {
    const std::lock_guard lock(mutex_);
    ++beats_;
    waiting = TakeWaiting();
  }
  for (const auto& notify : waiting) notify();
}

uint64_t EventHistory::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

uint64_t EventHistory::oldest() const {
  const std::lock_guard lock(mutex_);
  return Oldest();
}

bool EventFilter::Passes(const Event& event) const {
  if (!all_kinds && !kinds[static_cast<size_t>(event.kind)]) return false;
  return !event.link || links.empty() || (*event.link < links.size() && links[*event.link]);
}

EventCursor::EventCursor(EventHistory& history, uint64_t after, EventFilter filter,
                         std::function<void()> notify)
    : history_(history), filter_(std::move(filter)), notify_(std::move(notify)), position_(after) {
  const std::lock_guard lock(history_.mutex_);
  beat_told_ = history_.beats_;
  history_.cursors_.push_back(this);
}

EventCursor::~EventCursor() {
  const std::lock_guard lock(history_.mutex_);
  std::erase(history_.cursors_, this);
}

void EventCursor::SkipWhatIsGone() {
  const uint64_t before_oldest = history_.Oldest() - 1;
  if (position_ >= before_oldest) return;
  lost_ += before_oldest - position_;
  position_ = before_oldest;
}

void EventCursor::CatchUp() {
  const std::lock_guard lock(history_.mutex_);
  SkipWhatIsGone();
  lost_told_ = lost_;
}

EventCursor::Step EventCursor::Next() {
  const std::lock_guard lock(history_.mutex_);
  SkipWhatIsGone();
  // So that what is told of the place counts what nobody wants.
  const auto at = [&](uint64_t sequence) { return history_.ring_[sequence % history_.ring_.size()]; };
  while (position_ < history_.newest_ && !filter_.Passes(*at(position_ + 1))) ++position_;
  const bool status = lost_ != lost_told_ || beat_told_ != history_.beats_;
  lost_told_ = lost_;
  beat_told_ = history_.beats_;
  if (status) return {.event = nullptr, .status = true};
  if (position_ < history_.newest_) return {.event = at(++position_), .status = false};
  waiting_ = true;
  return {};
}

}  // namespace taclink::server

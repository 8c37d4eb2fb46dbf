#include "server/publish/outbox.h"

#include <utility>

namespace taclink::server {

void Outbox::Push(OutMessage message) {
  counts_.bytes += message.size();
  Waiting& queue = QueueOf(message);
  queue.emplace(next_order_++, std::move(message));
  MakeRoom();
}

void Outbox::MakeRoom() {
  while (counts_.bytes > most_bytes_) {
    if (!DropOldest(frames_, counts_.frames_dropped) && !DropOldest(others_, counts_.others_dropped)) return;
  }
}

bool Outbox::DropOldest(Waiting& queue, uint64_t& count) {
  if (queue.empty()) return false;
  counts_.bytes -= queue.begin()->second.size();
  queue.erase(queue.begin());
  ++count;
  return true;
}

const OutMessage* Outbox::Next() {
  if (frames_.empty() && others_.empty()) return nullptr;
  const bool frame = others_.empty() || (!frames_.empty() && frames_.begin()->first < others_.begin()->first);
  auto first = (frame ? frames_ : others_).extract((frame ? frames_ : others_).begin());
  std::string id = first.mapped().id;
  const auto sent = in_flight_.emplace(std::move(id), Sent{first.key(), std::move(first.mapped())});
  return &sent.first->second.message;
}

void Outbox::Acknowledge(const std::string& id) {
  const auto sent = in_flight_.find(id);
  if (sent == in_flight_.end()) return;  // the answer to an earlier sending came late
  counts_.bytes -= sent->second.message.size();
  ++counts_.acknowledged;
  in_flight_.erase(sent);
}

void Outbox::Return(const std::string& id) {
  const auto sent = in_flight_.find(id);
  if (sent == in_flight_.end()) return;
  ++counts_.sent_again;
  Waiting& queue = QueueOf(sent->second.message);
  queue.emplace(sent->second.order, std::move(sent->second.message));
  in_flight_.erase(sent);
}

void Outbox::ReturnAll() {
  while (!in_flight_.empty()) Return(std::string(in_flight_.begin()->first));
}

OutboxCounts Outbox::counts() const {
  OutboxCounts counts = counts_;
  counts.waiting = frames_.size() + others_.size();
  counts.in_flight = in_flight_.size();
  return counts;
}

}  // namespace taclink::server

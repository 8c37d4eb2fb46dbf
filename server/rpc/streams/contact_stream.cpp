#include "server/rpc/streams/contact_stream.h"

#include <utility>

#include "server/messages/contacts_message.h"

namespace taclink::server {

ContactStream::ContactStream(Arm& arm, double max_rate_hz, StreamRegistry& registry,
                             std::shared_ptr<boost::asio::thread_pool> senders)
    : PumpedStream(registry, std::move(senders)), arm_(arm), newest_(arm.links().size()), rate_(max_rate_hz) {
  link_names_ = arm.link_names();
}

void ContactStream::Begin() {
  subscription_ =
      arm_.hub().Subscribe({.delivery = Delivery::kLatest, .party_bytes = party_bytes()}, Notifier());
  Open();
}

// What is not due waits for the next link's news, which come at least once a second.
bool ContactStream::TakeNews() {
  bool due = false;
  while (const auto publication = subscription_->Take()) {
    newest_[publication->link()] = arm_.contacts().Of(*publication);
    unsent_ = true;
    due = rate_.Due(publication->state().times.published_ns) || due;
  }
  return sent_ == 0 || (unsent_ && due);
}

std::optional<grpc::ByteBuffer> ContactStream::Next() {
  if (!TakeNews()) return std::nullopt;
  Fill(newest_, link_names_, arm_.poses(), message_);
  message_.set_sequence(++sent_);
  message_.set_utc_ns(arm_.clock().UtcNs());
  unsent_ = false;
  const grpc::Slice slice(message_.SerializeAsString());
  return grpc::ByteBuffer(&slice, 1);
}

std::optional<grpc::ByteBuffer> ContactStream::Last(const std::string&) {
  return std::nullopt;
}

}  // namespace taclink::server

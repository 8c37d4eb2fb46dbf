#include "server/rpc/streams/stream_registry.h"

#include <utility>

namespace taclink::server {

StreamRegistry::StreamRegistry(const StreamLimits& limits, const ShareWords& words)
    : shares_(limits.streams, words), queue_bytes_per_party_(limits.queue_bytes_per_party) {}

Result<void> StreamRegistry::Admit(std::shared_ptr<PumpedStream> stream, const Party& party,
                                   const std::string& peer) {
  auto socket = socket_of_ ? socket_of_(peer) : nullptr;
  const std::lock_guard lock(mutex_);
  if (closed_) return Error{ErrorCode::kUnavailable, "server is shutting down"};
  if (const auto taken = shares_.Take(party); !taken) return taken;
  std::shared_ptr<ByteBudget> bytes;
  if (!party.who.empty()) {
    auto& of_party = queue_bytes_[party.who];
    if (!of_party) of_party = std::make_shared<ByteBudget>(queue_bytes_per_party_);
    bytes = of_party;
  }
  stream->SetResources(std::move(bytes), std::move(socket));
  streams_.emplace(std::move(stream), party);
  return {};
}

void StreamRegistry::SetLimits(const StreamLimits& limits) {
  const std::lock_guard lock(mutex_);
  shares_.SetLimits(limits.streams);
  queue_bytes_per_party_ = limits.queue_bytes_per_party;
  for (const auto& [party, bytes] : queue_bytes_) bytes->SetLimit(queue_bytes_per_party_);
}

void StreamRegistry::Remove(const std::shared_ptr<PumpedStream>& stream) {
  const std::lock_guard lock(mutex_);
  const auto at = streams_.find(stream);
  if (at == streams_.end()) return;
  shares_.Give(at->second);
  if (!shares_.Holds(at->second)) queue_bytes_.erase(at->second.who);
  streams_.erase(at);
  if (streams_.empty()) empty_.notify_all();
}

void StreamRegistry::Close(const std::string& reason) {
  std::map<std::shared_ptr<PumpedStream>, Party> streams;
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    streams = streams_;
  }
  for (const auto& [stream, party] : streams) stream->End(reason);
}

size_t StreamRegistry::streams() const {
  const std::lock_guard lock(mutex_);
  return streams_.size();
}

void StreamRegistry::WaitUntilEmpty(std::chrono::milliseconds patience) const {
  std::unique_lock lock(mutex_);
  empty_.wait_for(lock, patience, [this] { return streams_.empty(); });
}

}  // namespace taclink::server

#include "server/rpc/stream_registry.h"

#include <utility>

namespace taclink::server {

std::string PeerAddress(const std::string& peer) {
  if (peer.starts_with("ipv4:") || peer.starts_with("ipv6:")) return peer.substr(0, peer.rfind(':'));
  return peer.starts_with("unix:") ? "unix" : "";
}

Result<void> StreamRegistry::Admit(std::shared_ptr<PumpedStream> stream, const std::string& peer) {
  const auto full = [](size_t limit, const std::string& whose, const char* key) {
    return Error{ErrorCode::kResourceExhausted, "all " + std::to_string(limit) + " streams " + whose +
                                                    "are in use; close one or raise limits." + key};
  };
  std::string address = PeerAddress(peer);
  const std::lock_guard lock(mutex_);
  if (closed_) return Error{ErrorCode::kUnavailable, "server is shutting down"};
  if (streams_.size() >= max_streams_) return full(max_streams_, "", "max_streams");
  if (!address.empty()) {
    const auto used = by_address_.find(address);
    if (used != by_address_.end() && used->second >= max_streams_per_peer_)
      return full(max_streams_per_peer_, "for clients at " + address + " ", "max_streams_per_peer");
    ++by_address_[address];
  }
  streams_.emplace(std::move(stream), std::move(address));
  return {};
}

void StreamRegistry::SetMaxStreams(size_t max_streams, size_t max_streams_per_peer) {
  const std::lock_guard lock(mutex_);
  max_streams_ = max_streams;
  max_streams_per_peer_ = max_streams_per_peer;
}

void StreamRegistry::Remove(const std::shared_ptr<PumpedStream>& stream) {
  const std::lock_guard lock(mutex_);
  const auto at = streams_.find(stream);
  if (at == streams_.end()) return;
  if (const auto used = by_address_.find(at->second); used != by_address_.end() && --used->second == 0)
    by_address_.erase(used);
  streams_.erase(at);
  if (streams_.empty()) empty_.notify_all();
}

void StreamRegistry::Close(const std::string& reason) {
  std::map<std::shared_ptr<PumpedStream>, std::string> streams;
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    streams = streams_;
  }
  for (const auto& [stream, address] : streams) stream->End(reason);
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

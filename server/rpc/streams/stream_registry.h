#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "sensing/core/result.h"
#include "server/hub/byte_budget.h"
#include "server/rpc/streams/pumped_stream.h"
#include "server/security/shares.h"

namespace taclink::server {

struct StreamLimits {
  ShareLimits streams = {};
  size_t queue_bytes_per_party = 0;
};

/// All streams of a server; bounds their number, of all and of each party, and the memory of each party's
/// queues. Holds each stream until gRPC is done with it.
class StreamRegistry {
 public:
  static constexpr ShareWords kStreams{.things = "streams",
                                       .all_setting = "limits.max_streams",
                                       .party_setting = "limits.max_streams_per_peer"};

  explicit StreamRegistry(const StreamLimits& limits, const ShareWords& words = kStreams);

  /// `peer`: gRPC's text of where the call comes from. Errors: kResourceExhausted (which limit, and what to
  /// do), kUnavailable (closed).
  Result<void> Admit(std::shared_ptr<PumpedStream> stream, const Party& party, const std::string& peer);
  void Remove(const std::shared_ptr<PumpedStream>& stream);
  /// Ends all and takes no more.
  void Close(const std::string& reason);

  /// Finds the socket of a peer's connection; may give null. Before the first stream.
  void SetSockets(std::function<std::shared_ptr<const SharedSocket>(const std::string& peer)> socket_of) {
    socket_of_ = std::move(socket_of);
  }
  /// Streams that are open stay so.
  void SetLimits(const StreamLimits& limits);

  size_t streams() const;
  /// Waits until gRPC is done with all of them, for `patience` at most.
  void WaitUntilEmpty(std::chrono::milliseconds patience) const;

 private:
  std::function<std::shared_ptr<const SharedSocket>(const std::string& peer)> socket_of_;  // or empty

  mutable std::mutex mutex_;
  mutable std::condition_variable empty_;
  // Guarded by mutex_.
  Shares shares_;
  size_t queue_bytes_per_party_;
  std::map<std::shared_ptr<PumpedStream>, Party> streams_;
  std::map<std::string, std::shared_ptr<ByteBudget>> queue_bytes_;  // by party that has streams
  bool closed_ = false;
};

}  // namespace taclink::server

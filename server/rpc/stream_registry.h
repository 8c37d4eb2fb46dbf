#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "sensing/core/result.h"
#include "server/rpc/pumped_stream.h"

namespace taclink::server {

/// The address in what gRPC calls a peer, without the port: "ipv4:192.168.1.5". Empty for calls from within
/// this process.
std::string PeerAddress(const std::string& peer);

/// All streams of a server; bounds their number, of all and of each peer's address. Holds each until gRPC is
/// done with it.
class StreamRegistry {
 public:
  explicit StreamRegistry(size_t max_streams,
                          size_t max_streams_per_peer = std::numeric_limits<size_t>::max())
      : max_streams_(max_streams), max_streams_per_peer_(max_streams_per_peer) {}

  /// `peer` as the call's context has it. Errors: kResourceExhausted (which limit, and what to do),
  /// kUnavailable (closed).
  Result<void> Admit(std::shared_ptr<PumpedStream> stream, const std::string& peer);
  void Remove(const std::shared_ptr<PumpedStream>& stream);
  /// Ends all and takes no more.
  void Close(const std::string& reason);

  /// Streams that are open stay so.
  void SetMaxStreams(size_t max_streams, size_t max_streams_per_peer);

  size_t streams() const;
  /// Waits until gRPC is done with all of them, for `patience` at most.
  void WaitUntilEmpty(std::chrono::milliseconds patience) const;

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable empty_;
  // Guarded by mutex_.
  size_t max_streams_;
  size_t max_streams_per_peer_;
  std::map<std::shared_ptr<PumpedStream>, std::string> streams_;  // to the address
  std::map<std::string, size_t> by_address_;
  bool closed_ = false;
};

}  // namespace taclink::server

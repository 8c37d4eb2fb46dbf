#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <random>
#include <string>

#include "client/cpp/taclink/client.h"

namespace taclink::server {

/// What went wrong, first things first.
class Complaints {
 public:
  void Add(const std::string& what);
  uint64_t count() const { return count_; }

 private:
  std::mutex mutex_;
  std::atomic<uint64_t> count_ = 0;
};

struct ClientCounts {
  std::atomic<uint64_t> streams = 0, refused = 0, frames = 0, dropped = 0, statuses = 0;
};

/// Checks one stream: what arrives against what the server says that it sent and dropped.
class StreamCheck {
 public:
  StreamCheck(bool every, Complaints& complaints) : every_(every), complaints_(complaints) {}

  /// Each time after Next.
  void Counts(const v1::StreamStatus& status, ClientCounts& out);
  void Frame(const v1::LinkFrame& frame);

 private:
  struct PerLink {
    uint64_t received = 0;
    uint64_t sequence = 0;        // of the last picture
    int64_t order = 0, lost = 0;  // of what the link processed: the last, and those missing before it
    uint64_t dropped_told = 0;
  };

  const bool every_;
  Complaints& complaints_;
  std::map<std::string, PerLink> links_;
};

/// Connects, streams for a while in one of many ways, and goes; over and over until `end`.
void RunSoakClient(const std::string& address, uint64_t seed, std::chrono::steady_clock::time_point end,
                   Complaints& complaints, ClientCounts& counts);

}  // namespace taclink::server

#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/clock.h"
#include "server/hub/hub.h"
#include "server/rpc/streams/pumped_stream.h"

namespace taclink::server {

struct FrameStreamOptions {
  SubscriberOptions subscriber;
  Detail detail = Detail::kContacts;
};

/// One client's StreamFrames call: what its subscription has, and how many it missed.
class FrameStream final : public PumpedStream {
 public:
  /// `link_names` by link. `clock` is the one that frames are published by.
  FrameStream(FrameStreamOptions options, std::vector<std::string> link_names, const Clock& clock,
              StreamRegistry& registry, std::shared_ptr<boost::asio::thread_pool> senders);

  /// Begins to send. Only once the registry holds the stream.
  void Begin(Hub& hub);

 private:
  std::optional<grpc::ByteBuffer> Next() override;
  std::optional<grpc::ByteBuffer> Last(const std::string& reason) override;
  grpc::ByteBuffer Status(const std::string& end_reason);
  bool IsStatusDue() const;
  grpc::ByteBuffer Frame(const Publication& publication, bool unchanged) const;

  // Constant after construction.
  const FrameStreamOptions options_;
  const std::vector<std::string> link_names_;
  const Clock& clock_;
  // Set by Begin.
  std::unique_ptr<Subscription> subscription_;
  int64_t begun_ns_ = 0;

  // Used by one thread at a time.
  bool status_sent_ = false;   // at least the first
  uint64_t dropped_told_ = 0;  // in the last status
  std::chrono::steady_clock::time_point status_time_;
  int64_t under_way_ns_ = 0;  // publication of the frame that is being sent, monotonic; 0: none
  int64_t lateness_ns_ = 0;   // the largest since the last status
  bool was_late_ = false;     // the last status said so
};

}  // namespace taclink::server

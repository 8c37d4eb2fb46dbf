#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

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
  /// `link_names` by link.
  FrameStream(FrameStreamOptions options, std::vector<std::string> link_names, StreamRegistry& registry,
              std::shared_ptr<boost::asio::thread_pool> senders);

  /// Begins to send. Only once the registry holds the stream.
  void Begin(Hub& hub);

 private:
  std::optional<grpc::ByteBuffer> Next() override;
  std::optional<grpc::ByteBuffer> Last(const std::string& reason) override;
  grpc::ByteBuffer Status(const std::string& end_reason);
  grpc::ByteBuffer Frame(const Publication& publication, bool unchanged) const;

  // Constant after construction.
  const FrameStreamOptions options_;
  const std::vector<std::string> link_names_;
  std::unique_ptr<Subscription> subscription_;  // set by Begin

  // Used by one thread at a time.
  bool status_sent_ = false;   // at least the first
  uint64_t dropped_told_ = 0;  // in the last status
  std::chrono::steady_clock::time_point status_time_;
};

}  // namespace taclink::server

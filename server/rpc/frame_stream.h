#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "server/hub.h"

namespace taclink::server {

struct FrameStreamOptions {
  SubscriberOptions subscriber;
  Detail detail = Detail::kContacts;
};

class StreamRegistry;

/// One client's StreamFrames call: takes from its subscription and has one message under way at a time. While
/// the client does not read, gRPC's flow control keeps that message, and what it misses is dropped in its
/// queue.
class FrameStream final : public grpc::ServerWriteReactor<grpc::ByteBuffer>,
                          public std::enable_shared_from_this<FrameStream> {
 public:
  /// `link_names` by link. Sending goes on in `senders`, so that publishers are not kept by gRPC.
  FrameStream(FrameStreamOptions options, std::vector<std::string> link_names, StreamRegistry& registry,
              std::shared_ptr<boost::asio::thread_pool> senders);

  /// Begins to send. Only once the registry holds the stream.
  void Begin(Hub& hub);
  /// The server ends the stream and tells why.
  void End(const std::string& reason);

 private:
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  /// Starts the next write if none is under way and there is something to send.
  void Pump();
  enum class Step { kNothing, kWrite, kWriteLast, kFinishCancelled };
  Step Decide();
  void MakeStatus();
  void MakeFrame(const Publication& publication);

  // Constant after construction.
  const FrameStreamOptions options_;
  const std::vector<std::string> link_names_;
  StreamRegistry& registry_;
  const std::shared_ptr<boost::asio::thread_pool> senders_;
  std::unique_ptr<Subscription> subscription_;  // set by Begin

  std::mutex mutex_;
  // Guarded by mutex_.
  bool writing_ = false;
  bool cancelled_ = false;
  bool finished_ = false;
  std::string end_reason_;     // not empty: the server ends the stream
  bool status_sent_ = false;   // at least the first
  uint64_t dropped_told_ = 0;  // in the last status
  std::chrono::steady_clock::time_point status_time_;

  grpc::ByteBuffer message_;  // under way while writing_
};

/// All streams of a server; bounds their number. Holds each until gRPC is done with it.
class StreamRegistry {
 public:
  explicit StreamRegistry(size_t max_streams) : max_streams_(max_streams) {}

  enum class Added { kYes, kFull, kClosed };
  Added Add(std::shared_ptr<FrameStream> stream);
  void Remove(const std::shared_ptr<FrameStream>& stream);
  /// Ends all and takes no more.
  void Close(const std::string& reason);

  size_t max_streams() const { return max_streams_; }
  size_t streams() const;

 private:
  // Constant after construction.
  const size_t max_streams_;
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::set<std::shared_ptr<FrameStream>> streams_;
  bool closed_ = false;
};

}  // namespace taclink::server

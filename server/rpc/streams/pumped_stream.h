#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace taclink::server {

class ByteBudget;
class SharedSocket;
class StreamRegistry;

/// One client's server-streaming call with one message under way at a time: while the client does not read,
/// gRPC's flow control keeps that message, and who makes the messages decides what it misses. On a slow link
/// the next message is made only when it can be sent soon (SendDelay), so that it is a new one and urgent
/// streams find the link free. Heirs make the messages (Next, Last) and call the notifier when there may be
/// one.
class PumpedStream : public grpc::ServerWriteReactor<grpc::ByteBuffer>,
                     public std::enable_shared_from_this<PumpedStream> {
 public:
  ~PumpedStream() override = default;

  /// The server ends the stream and tells why. Any thread.
  void End(const std::string& reason);
  /// By the registry, which admits it: memory for what waits, shared with the other streams of the same
  /// party, and the socket of its connection (null: it has none of its own).
  void SetResources(std::shared_ptr<ByteBudget> bytes, std::shared_ptr<const SharedSocket> socket) {
    party_bytes_ = std::move(bytes);
    socket_ = std::move(socket);
  }

 protected:
  /// Messages of urgent streams are few and small: they do not wait until the link is free.
  enum class Urgency { kOrdinary, kUrgent };
  /// Sending goes on in `senders`, so that those who notify are not kept by gRPC.
  PumpedStream(StreamRegistry& registry, std::shared_ptr<boost::asio::thread_pool> senders,
               Urgency urgency = Urgency::kOrdinary);

  /// Begins to send. Only once the registry holds the stream and Next may be called.
  void Open();
  /// To be called, by any thread, when Next may have something again. Outlives the stream.
  std::function<void()> Notifier();
  const std::shared_ptr<ByteBudget>& party_bytes() const { return party_bytes_; }

  /// The next message, or none yet: then a notification will follow when there is one. One thread at a time.
  virtual std::optional<grpc::ByteBuffer> Next() = 0;
  /// The message before the server ends the stream; none: only the status tells. One thread at a time.
  virtual std::optional<grpc::ByteBuffer> Last(const std::string& reason) = 0;
  /// For Next: the call ends so once it has been asked again and had no more.
  void EndWith(const grpc::Status& status) { end_ = status; }

 private:
  void OnWriteDone(bool ok) final;
  void OnCancel() final;
  void OnDone() final;

  /// Starts the next write if none is under way and there is something to send.
  void Pump();
  enum class Step { kNothing, kWrite, kFinish };
  Step Decide();
  /// False: not now; Pump is called again.
  bool MaySend();

  // Constant after construction.
  StreamRegistry& registry_;
  const std::shared_ptr<boost::asio::thread_pool> senders_;
  const Urgency urgency_;
  // Set by the registry, before it begins.
  std::shared_ptr<ByteBudget> party_bytes_;
  std::shared_ptr<const SharedSocket> socket_;

  std::mutex mutex_;
  // Guarded by mutex_.
  bool open_ = false;
  bool writing_ = false;
  bool cancelled_ = false;
  bool finished_ = false;
  bool last_made_ = false;           // by Last
  bool delayed_ = false;             // retry_ is set
  std::string end_reason_;           // not empty: the server ends the stream
  std::optional<grpc::Status> end_;  // by Next
  boost::asio::steady_timer retry_;

  grpc::ByteBuffer message_;  // under way while writing_
};

}  // namespace taclink::server

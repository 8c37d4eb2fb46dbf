#pragma once

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/thread_pool.hpp>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "server/rpc/streams/pumped_stream.h"
#include "server/rpc/streams/replay_desk.h"
#include "server/rpc/streams/replay_request.h"
#include "taclink/v1/recording.pb.h"

namespace taclink::server {

/// A log, or why it can't be played.
struct OpenedLog {
  std::shared_ptr<const mcap::Reader> reader;  ///< null: see status
  grpc::Status status;
};

/// One client's Replay call. One message waits to be taken by gRPC while one is under way, so that a client
/// that reads slowly makes the player late, or, at speed 0, slow. The player, its timer and its reads are in
/// a strand of the players' threads.
class ReplayStream final : public PumpedStream {
 public:
  ReplayStream(ReplayOrder order, std::string peer, std::shared_ptr<ReplayDesk> desk,
               StreamRegistry& registry, std::shared_ptr<boost::asio::thread_pool> senders,
               std::shared_ptr<boost::asio::thread_pool> players);
  ~ReplayStream() override;

  /// Begins to send once `open`, done in `files`, has the log. Only once the registry holds the stream.
  void Begin(boost::asio::thread_pool& files, std::function<OpenedLog()> open);

  /// `done` hears what became of it, in the players' threads. Any thread.
  void Control(const v1::ControlReplayRequest& request, std::function<void(const grpc::Status&)> done);

  /// Once the desk has the stream.
  const mcap::Reader& reader() const { return *reader_; }

 private:
  std::optional<grpc::ByteBuffer> Next() override;
  std::optional<grpc::ByteBuffer> Last(const std::string& reason) override;

  // In the strand.
  void OnOpened(const OpenedLog& log);
  Result<void> MakePlayer(std::shared_ptr<const mcap::Reader> reader);
  void Prepare();
  bool PrepareMessage(const PlayerStep& step);
  std::string Status(int64_t now_ns);
  Result<void> Apply(const v1::ControlReplayRequest& request);
  void WakeAt(int64_t time_ns);
  void Fail(const grpc::Status& status);
  void Put(const std::string& bytes, std::optional<int64_t> due_ns, std::optional<grpc::Status> end = {});

  bool Waits() const;  // for gRPC, or has ended

  // Constant after construction.
  const ReplayOrder order_;
  const std::string peer_;
  const std::shared_ptr<ReplayDesk> desk_;
  const std::shared_ptr<boost::asio::thread_pool> players_;

  // Used in the strand.
  boost::asio::strand<boost::asio::thread_pool::executor_type> strand_;
  boost::asio::steady_timer timer_;
  std::shared_ptr<const mcap::Reader> reader_;  // constant once the desk has the stream
  std::string id_;                              // empty: the log is not open yet
  std::map<uint16_t, wire::log::Topic> topics_;
  std::unique_ptr<LogPlayer> player_;
  bool status_due_ = true;
  int64_t status_at_ns_ = 0;  // at the latest, steady clock
  uint64_t unreadable_ = 0;   // messages
  std::function<void()> notify_;

  mutable std::mutex piece_mutex_;
  // Guarded by piece_mutex_.
  std::optional<grpc::ByteBuffer> piece_;
  std::optional<int64_t> piece_due_ns_;
  int64_t lateness_ns_ = 0;          // since the last status
  std::optional<grpc::Status> end_;  // after piece_
};

}  // namespace taclink::server

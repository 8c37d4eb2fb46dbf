#pragma once

#include <boost/asio/thread_pool.hpp>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "mcap/byte_source.h"
#include "server/rpc/streams/pumped_stream.h"

namespace taclink::server {

/// One client's DownloadLog call. The next piece is read while one is under way.
class DownloadStream final : public PumpedStream {
 public:
  /// `files`: reads. `offset` is not past the end of `source`.
  DownloadStream(std::shared_ptr<const mcap::ByteSource> source, uint64_t offset, StreamRegistry& registry,
                 std::shared_ptr<boost::asio::thread_pool> senders,
                 std::shared_ptr<boost::asio::thread_pool> files);

  /// Begins to send. Only once the registry holds the stream.
  void Begin();

 private:
  std::optional<grpc::ByteBuffer> Next() override;
  std::optional<grpc::ByteBuffer> Last(const std::string& reason) override;
  void ReadAhead();
  void Read();

  // Constant after construction.
  const std::shared_ptr<const mcap::ByteSource> source_;
  const std::shared_ptr<boost::asio::thread_pool> files_;

  std::mutex piece_mutex_;
  // Guarded by piece_mutex_.
  uint64_t offset_;  // of the next piece
  std::optional<grpc::ByteBuffer> piece_;
  std::optional<grpc::Status> failed_;
};

}  // namespace taclink::server

#include "server/rpc/streams/download_stream.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <utility>

#include "server/rpc/requests/status.h"
#include "taclink/v1/recording.pb.h"

namespace taclink::server {
namespace {

constexpr uint64_t kPieceBytes = uint64_t{1} << 20;

}  // namespace

DownloadStream::DownloadStream(std::shared_ptr<const mcap::ByteSource> source, uint64_t offset,
                               StreamRegistry& registry, std::shared_ptr<boost::asio::thread_pool> senders,
                               std::shared_ptr<boost::asio::thread_pool> files)
    : PumpedStream(registry, std::move(senders)),
      source_(std::move(source)),
      files_(std::move(files)),
      offset_(offset) {}

void DownloadStream::Begin() {
  ReadAhead();
  Open();
}

void DownloadStream::ReadAhead() {
  boost::asio::post(*files_, [weak = weak_from_this(), this] {
    if (const auto self = weak.lock()) Read();
  });
}

void DownloadStream::Read() {
  {
    const std::lock_guard lock(piece_mutex_);
    const uint64_t bytes = std::min(source_->size() - offset_, kPieceBytes);
    v1::DownloadLogResponse response;
    response.set_offset(offset_);
    response.set_size(source_->size());
    response.mutable_data()->resize(bytes);
    const auto read = source_->Read(offset_, std::as_writable_bytes(std::span(*response.mutable_data())));
    if (read) {
      offset_ += bytes;
      const grpc::Slice slice(response.SerializeAsString());
      piece_ = grpc::ByteBuffer(&slice, 1);
    } else {
      failed_ = ToGrpc(read.error());
    }
  }
  Notifier()();
}

// An empty log, or nothing behind the offset, is one empty piece.
std::optional<grpc::ByteBuffer> DownloadStream::Next() {
  const std::lock_guard lock(piece_mutex_);
  if (failed_) EndWith(*failed_);
  if (!piece_) return std::nullopt;
  auto piece = std::exchange(piece_, std::nullopt);
  if (offset_ == source_->size()) {
    EndWith(grpc::Status::OK);
  } else {
    ReadAhead();
  }
  return piece;
}

std::optional<grpc::ByteBuffer> DownloadStream::Last(const std::string&) {
  return std::nullopt;
}

}  // namespace taclink::server

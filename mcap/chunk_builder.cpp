#include "mcap/chunk_builder.h"

#include <algorithm>

namespace taclink::mcap {
namespace {

constexpr size_t kWorthBorrowing = 4096;  // bytes; less is copied faster than it is gathered

}  // namespace

void ChunkBuilder::Add(const Schema& schema) {
  const size_t before = copied_.size();
  Append(schema, copied_);
  size_ += copied_.size() - before;
}

void ChunkBuilder::Add(const Channel& channel) {
  const size_t before = copied_.size();
  Append(channel, copied_);
  size_ += copied_.size() - before;
}

void ChunkBuilder::Add(const Message& message, std::shared_ptr<const void> owner) {
  MessageIndex& index = indexes_[message.channel_id];
  index.channel_id = message.channel_id;
  index.records.emplace_back(message.log_time_ns, size_);
  AppendMessagePrefix(message, copied_);
  if (owner && message.data.size() >= kWorthBorrowing) {
    borrowed_.push_back({.copied_before = copied_.size(), .bytes = message.data, .owner = std::move(owner)});
  } else {
    AppendBytes(message.data, copied_);
  }
  size_ += kRecordHeaderBytes + kMessagePrefixBytes + message.data.size();
  start_ns_ = messages_ == 0 ? message.log_time_ns : std::min(start_ns_, message.log_time_ns);
  end_ns_ = std::max(end_ns_, message.log_time_ns);
  ++messages_;
}

void ChunkBuilder::Clear() {
  copied_.clear();
  borrowed_.clear();
  for (auto& [id, index] : indexes_) index.records.clear();
  size_ = messages_ = start_ns_ = end_ns_ = 0;
}

void ChunkBuilder::AppendPieces(std::vector<Bytes>& out) const {
  size_t done = 0;
  const auto copied_until = [&](size_t end) {
    if (end > done) out.push_back(Bytes(copied_).subspan(done, end - done));
    done = end;
  };
  for (const Borrowed& borrowed : borrowed_) {
    copied_until(borrowed.copied_before);
    out.push_back(borrowed.bytes);
  }
  copied_until(copied_.size());
}

}  // namespace taclink::mcap

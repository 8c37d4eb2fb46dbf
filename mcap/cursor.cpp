#include "mcap/cursor.h"

#include <algorithm>
#include <string>
#include <utility>

namespace taclink::mcap {

MessageCursor::MessageCursor(const Reader& reader, CursorOptions options)
    : reader_(reader), options_(std::move(options)) {
  const std::vector<MessageBlock>& blocks = reader_.blocks_;
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (Wanted(i)) pending_.push_back(i);
  }
  if (options_.order == MessageOrder::kLogTime) {
    std::ranges::stable_sort(pending_, {}, [&](size_t i) { return blocks[i].start_ns; });
  } else if (options_.order == MessageOrder::kReverseLogTime) {
    std::ranges::reverse(pending_);
    std::ranges::stable_sort(pending_, std::greater<>(), [&](size_t i) { return blocks[i].end_ns; });
  }
}

bool MessageCursor::Wanted(size_t block) const {
  const MessageBlock& candidate = reader_.blocks_[block];
  if (candidate.end_ns < options_.start_ns || candidate.start_ns > options_.end_ns) return false;
  if (!options_.channels || reader_.scan_) return true;
  const ChannelMap& indexed = reader_.summary_.chunk_indexes[block].message_index_offsets;
  return indexed.empty() || std::ranges::any_of(indexed, [&](const auto& entry) {
           return options_.channels->contains(entry.first);
         });
}

bool MessageCursor::MayComeFirst(size_t block) const {
  if (open_.empty()) return true;
  const uint64_t next = open_.front()->entries.back().time_ns;
  switch (options_.order) {
    case MessageOrder::kLogTime:
      return reader_.blocks_[block].start_ns <= next;
    case MessageOrder::kReverseLogTime:
      return reader_.blocks_[block].end_ns >= next;
    case MessageOrder::kFile:
      break;
  }
  return false;
}

bool MessageCursor::ComesLater(const OpenBlock& a, const OpenBlock& b) const {
  const auto key = [](const OpenBlock& open) { return std::pair(open.entries.back().time_ns, open.block); };
  return options_.order == MessageOrder::kReverseLogTime ? key(a) < key(b) : key(a) > key(b);
}

void MessageCursor::Push(std::unique_ptr<OpenBlock> open) {
  open_.push_back(std::move(open));
  std::ranges::push_heap(open_, [&](const auto& a, const auto& b) { return ComesLater(*a, *b); });
}

Result<Message> MessageCursor::Next() {
  if (newest_) open_bytes_ -= newest_->bytes.size();
  newest_.reset();
  while (!pending_.empty() && MayComeFirst(pending_.front())) {
    const size_t block = pending_.front();
    pending_.pop_front();
    if (const auto loaded = Load(block); !loaded) return loaded.error();
  }
  if (open_.empty()) return Error{ErrorCode::kEndOfData, "no more messages"};
  std::ranges::pop_heap(open_, [&](const auto& a, const auto& b) { return ComesLater(*a, *b); });
  std::unique_ptr<OpenBlock> open = std::move(open_.back());
  open_.pop_back();
  const Bytes content = open->entries.back().content;
  open->entries.pop_back();
  if (open->entries.empty()) {
    newest_ = std::move(open);
  } else {
    Push(std::move(open));
  }
  return Decode<Message>(content);
}

Result<void> MessageCursor::Load(size_t block) {
  const MessageBlock& place = reader_.blocks_[block];
  auto open = std::make_unique<OpenBlock>();
  open->block = block;
  const auto records = LoadRecords(place, open->bytes);
  if (!records) return records.error();
  ++blocks_read_;
  if (const auto found = FindEntries(place, *records, *open); !found) return found;
  if (open->entries.empty()) return {};
  if (open->bytes.size() > reader_.limits_.open_bytes - std::min(open_bytes_, reader_.limits_.open_bytes)) {
    return At(place.offset,
              Error{ErrorCode::kResourceExhausted,
                    "chunks that overlap in time are together above the limit of " +
                        std::to_string(reader_.limits_.open_bytes) + " bytes: read in file order"});
  }
  open_bytes_ += open->bytes.size();
  // Taken from the back.
  if (options_.order != MessageOrder::kFile) std::ranges::stable_sort(open->entries, {}, &Entry::time_ns);
  if (options_.order != MessageOrder::kReverseLogTime) std::ranges::reverse(open->entries);
  Push(std::move(open));
  return {};
}

Result<Bytes> MessageCursor::LoadRecords(const MessageBlock& block, Buffer& bytes) const {
  if (!block.is_chunk) {
    bytes.resize(static_cast<size_t>(block.length));
    if (const auto read = reader_.source_->Read(block.offset, bytes); !read) return read.error();
    return Bytes(bytes);
  }
  Buffer raw;
  const auto chunk =
      ReadRecordAs<Chunk>(*reader_.source_, Opcode::kChunk, block.offset, reader_.limits_, raw);
  if (!chunk) return chunk.error();
  const auto records = LoadChunk(*chunk, reader_.limits_, bytes);
  if (!records) return At(block.offset, records.error());
  if (!chunk->compression.empty()) return records;
  bytes = std::move(raw);  // keeps its place in memory
  return records;
}

Result<void> MessageCursor::FindEntries(const MessageBlock& block, Bytes records, OpenBlock& out) const {
  const bool scanned = reader_.scan_.has_value();  // then what does not fit was counted by the scan
  while (!records.empty()) {
    const auto record = TakeRecord(records);
    if (!record && scanned) break;
    if (!record) return At(block.offset, "in this chunk: " + record.error().message);
    if (record->opcode != Opcode::kMessage) continue;
    const auto message = Decode<Message>(record->content);
    if (!message && scanned) break;
    if (!message) return At(block.offset, "in this chunk: " + message.error().message);
    if (!reader_.summary_.channels.contains(message->channel_id)) {
      if (scanned) continue;
      return At(block.offset, "in this chunk is a message of channel " + std::to_string(message->channel_id) +
                                  ", which the summary does not name");
    }
    const uint64_t time = message->log_time_ns;
    if (time < block.start_ns || time > block.end_ns) {
      if (scanned) continue;
      return At(block.offset, "in this chunk is a message outside of the times that its index gives");
    }
    if (time < options_.start_ns || time > options_.end_ns) continue;
    if (options_.channels && !options_.channels->contains(message->channel_id)) continue;
    out.entries.push_back({.time_ns = time, .content = record->content});
  }
  return {};
}

}  // namespace taclink::mcap

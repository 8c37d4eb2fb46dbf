#include <algorithm>

#include "mcap/scanner.h"

namespace taclink::mcap {

Result<void> Scanner::TakeChunk(const Place& place, Bytes content) {
  const auto chunk = Decode<Chunk>(content);
  if (!chunk) {
    ++report_.damaged_chunks;
    return At(place.offset, chunk.error());
  }
  const auto records = LoadChunk(*chunk, options_.limits, chunk_);
  if (!records) return TakeDamagedChunk(place, *chunk, records.error());
  const bool verified = chunk->uncompressed_crc != 0;
  if (!verified && !place.length_is_right()) {
    ++report_.damaged_chunks;
    return At(place.offset, "a damaged Chunk");
  }
  has_chunks_ = true;
  ++report_.chunks;
  const size_t prefix = kRecordHeaderBytes + static_cast<size_t>(chunk->records.data() - content.data());
  ChunkIndex index = IndexOf(*chunk, place.offset, prefix, chunk->records.size());
  index.chunk_length = place.end - place.offset;
  const auto parsed = TakeChunkRecords(
      *records,
      {.offset = place.offset, .length = place.end - place.offset, .in_chunk = true, .verified = verified},
      index);
  if (!parsed) return parsed.error();
  if (*parsed < records->size()) {
    report_.damaged_chunks += 1;
    report_.chunks -= 1;
    SkipDamage(place.offset, place.end, "a chunk's records are damaged");
  }
  return Told(visitor_.OnChunk(index));
}

Result<void> Scanner::TakeDamagedChunk(const Place& place, const Chunk& chunk, const Error& error) {
  ++report_.damaged_chunks;
  const auto spared = FindSparedChunk();
  if (!spared) return spared.error();
  const bool plain = chunk.compression.empty() && place.length_is_right() && !*spared;
  if (plain && options_.keep_unverified) {
    ChunkIndex index;
    const MessagePlace in{.offset = place.offset, .length = place.end - place.offset, .in_chunk = true};
    const auto parsed = TakeChunkRecords(chunk.records, in, index);
    if (!parsed) return parsed.error();
  } else if (plain) {
    report_.dropped += CountMessages(chunk.records);
  }
  return At(place.offset, error);
}

uint64_t Scanner::CountMessages(Bytes records) const {
  uint64_t messages = 0;
  while (!records.empty()) {
    const auto record = TakeRecord(records);
    if (!record) break;
    messages += record->opcode == Opcode::kMessage && record->content.size() >= kMessagePrefixBytes ? 1 : 0;
  }
  return messages;
}

Result<size_t> Scanner::TakeChunkRecords(Bytes records, const MessagePlace& place, ChunkIndex& index) {
  const size_t size = records.size();
  bool first = true;
  while (!records.empty()) {
    const size_t before = size - records.size();
    const auto record = TakeRecord(records);
    if (!record) return before;
    if (record->opcode == Opcode::kSchema) {
      const auto schema = Decode<Schema>(record->content);
      if (!schema) return before;
      if (const auto taken = TakeSchema(*schema); !taken) return taken.error();
    } else if (record->opcode == Opcode::kChannel) {
      const auto channel = Decode<Channel>(record->content);
      if (!channel) return before;
      if (const auto taken = TakeChannel(*channel); !taken) return taken.error();
    } else if (record->opcode == Opcode::kMessage) {
      const auto message = Decode<Message>(record->content);
      if (!message) return before;
      const uint64_t time = message->log_time_ns;
      index.message_start_ns = first ? time : std::min(index.message_start_ns, time);
      index.message_end_ns = first ? time : std::max(index.message_end_ns, time);
      first = false;
      if (const auto taken = TakeMessage(*message, place); !taken) return taken.error();
    } else if (IsKnown(record->opcode)) {
      return before;
    }
  }
  return size;
}

Result<void> Scanner::TakeSchema(const Schema& schema) {
  if (schema.id == 0) return {};
  const auto [known, added] = schemas_.try_emplace(schema.id, schema);
  if (!added && known->second == schema) return {};
  if (!added) ++report_.redefinitions;
  known->second = schema;
  return Told(visitor_.OnSchema(schema));
}

Result<void> Scanner::TakeChannel(const Channel& channel) {
  const auto [known, added] = channels_.try_emplace(channel.id, channel);
  if (!added && known->second == channel) return {};
  if (!added) ++report_.redefinitions;
  known->second = channel;
  if (channel.schema_id != 0 && !schemas_.contains(channel.schema_id) && summary_) {
    const auto schema = summary_->schemas.find(channel.schema_id);
    if (schema != summary_->schemas.end()) {
      if (const auto taken = TakeSchema(schema->second); !taken) return taken;
    }
  }
  return Told(visitor_.OnChannel(channel));
}

Result<bool> Scanner::FindChannel(uint16_t id) {
  if (channels_.contains(id)) return true;
  if (!summary_) return false;
  const auto channel = summary_->channels.find(id);
  if (channel == summary_->channels.end()) return false;
  if (const auto taken = TakeChannel(channel->second); !taken) return taken.error();
  return true;
}

Result<bool> Scanner::TakeMessage(const Message& message, const MessagePlace& place) {
  const auto found = FindChannel(message.channel_id);
  if (!found) return found.error();
  if (!*found) {
    ++report_.orphans;
    return false;
  }
  ++report_.messages;
  report_.unverified += place.verified ? 0 : 1;
  ++report_.channel_messages[message.channel_id];
  NoteSequence(message);
  if (const auto taken = Told(visitor_.OnMessage(message, place)); !taken) return taken.error();
  return true;
}

void Scanner::NoteSequence(const Message& message) {
  constexpr uint32_t kHalf = uint32_t{1} << 31;  // more: the numbers went back
  const auto [newest, first] = sequences_.try_emplace(message.channel_id, message.sequence);
  const uint32_t step = message.sequence - newest->second;
  if (!first && step > 1 && step < kHalf) {
    SequenceGaps& gaps = report_.sequence_gaps[message.channel_id];
    ++gaps.gaps;
    gaps.missing += step - 1;
  }
  newest->second = message.sequence;
}

}  // namespace taclink::mcap

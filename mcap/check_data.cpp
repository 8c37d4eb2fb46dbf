#include <algorithm>

#include "mcap/checker.h"

namespace taclink::mcap {
namespace {

std::string Named(const char* what, uint16_t id) {
  return std::string(what) + " " + std::to_string(id);
}

}  // namespace

void Checker::VisitData(const RawRecord& record, uint64_t length) {
  switch (record.opcode) {
    case Opcode::kHeader:
      return;
    case Opcode::kSchema:
      return VisitSchema(offset_, record.content);
    case Opcode::kChannel:
      return VisitChannel(offset_, record.content);
    case Opcode::kMessage:
      if (VisitMessage(offset_, record.content)) ++loose_messages_;
      return;
    case Opcode::kChunk:
      return VisitChunk(record.content, length);
    case Opcode::kMessageIndex:
      return VisitMessageIndex(record.content, length);
    case Opcode::kAttachment:
      return VisitAttachment(record.content, length);
    case Opcode::kMetadata:
      return VisitMetadata(record.content, length);
    default:
      Wrong(offset_, NameOf(record.opcode) + " in the data section");
  }
}

void Checker::VisitSchema(uint64_t offset, Bytes content) {
  const auto schema = Decoded<Schema>(offset, content);
  if (!schema) return;
  if (schema->id == 0) return Wrong(offset, "a schema with the id 0");
  CheckText(offset, schema->name, "a schema's name");
  CheckText(offset, schema->encoding, "a schema's encoding");
  if (schema->encoding.empty() && !schema->data.empty()) Doubt(offset, "a schema with data, but no encoding");
  const auto [known, added] = found_.schemas.try_emplace(schema->id, *schema);
  if (!added && !(known->second == *schema))
    Wrong(offset, Named("schema", schema->id) + " differs from before");
}

void Checker::VisitChannel(uint64_t offset, Bytes content) {
  const auto channel = Decoded<Channel>(offset, content);
  if (!channel) return;
  CheckText(offset, channel->topic, "a channel's topic");
  CheckText(offset, channel->message_encoding, "a channel's message encoding");
  for (const auto& [key, value] : channel->metadata) {
    CheckText(offset, key, "a channel's metadata");
    CheckText(offset, value, "a channel's metadata");
  }
  if (channel->schema_id != 0 && !found_.schemas.contains(channel->schema_id)) {
    Wrong(offset,
          Named("channel", channel->id) + " comes before its schema " + std::to_string(channel->schema_id));
  }
  const auto [known, added] = found_.channels.try_emplace(channel->id, *channel);
  if (!added && !(known->second == *channel))
    Wrong(offset, Named("channel", channel->id) + " differs from before");
}

std::optional<Message> Checker::VisitMessage(uint64_t offset, Bytes content) {
  const auto message = Decoded<Message>(offset, content);
  if (!message) return std::nullopt;
  if (!found_.channels.contains(message->channel_id)) {
    Wrong(offset, "a message comes before its " + Named("channel", message->channel_id));
  }
  Statistics& counted = *found_.statistics;
  const uint64_t time = message->log_time_ns;
  counted.message_start_ns = counted.message_count == 0 ? time : std::min(counted.message_start_ns, time);
  counted.message_end_ns = std::max(counted.message_end_ns, time);
  ++counted.message_count;
  ++counted.channel_message_counts[message->channel_id];
  return message;
}

void Checker::VisitChunk(Bytes content, uint64_t length) {
  ++found_.statistics->chunk_count;
  const auto chunk = Decoded<Chunk>(offset_, content);
  if (!chunk) return;
  newest_chunk_.emplace().offset = offset_;
  ChunkIndex index = IndexOf(*chunk, offset_, length - chunk->records.size(), chunk->records.size());
  index.message_start_ns = index.message_end_ns = 0;
  const auto records = LoadChunk(*chunk, limits_, chunk_);
  if (records) {
    uint64_t messages = 0;
    Bytes rest = *records;
    while (!rest.empty()) {
      const uint64_t at = records->size() - rest.size();
      const auto record = TakeRecord(rest);
      if (!record) {
        Wrong(offset_, "in this chunk: " + record.error().message);
        break;
      }
      VisitChunkRecord(*record, at, index, messages);
    }
    if (index.message_start_ns != chunk->message_start_ns || index.message_end_ns != chunk->message_end_ns) {
      Wrong(offset_, "a chunk's times are not those of its messages");
    }
  } else {
    Wrong(offset_, records.error().message);
  }
  for (auto& [id, entries] : newest_chunk_->messages) std::ranges::sort(entries);
  found_.chunk_indexes.push_back(std::move(index));
}

void Checker::VisitChunkRecord(const RawRecord& record, uint64_t offset, ChunkIndex& index,
                               uint64_t& messages) {
  if (record.opcode == Opcode::kSchema) return VisitSchema(offset_, record.content);
  if (record.opcode == Opcode::kChannel) return VisitChannel(offset_, record.content);
  if (record.opcode == Opcode::kMessage) {
    const auto message = VisitMessage(offset_, record.content);
    if (!message) return;
    const uint64_t time = message->log_time_ns;
    index.message_start_ns = messages == 0 ? time : std::min(index.message_start_ns, time);
    index.message_end_ns = std::max(index.message_end_ns, time);
    newest_chunk_->messages[message->channel_id].emplace_back(time, offset);
    ++messages;
    return;
  }
  if (IsKnown(record.opcode)) return Wrong(offset_, NameOf(record.opcode) + " in a chunk");
  VisitUnknown(record.opcode);
}

void Checker::VisitMessageIndex(Bytes content, uint64_t length) {
  auto index = Decoded<MessageIndex>(offset_, content);
  if (!index) return;
  if (!newest_chunk_) return Wrong(offset_, "a MessageIndex that does not follow a chunk");
  ChunkIndex& chunk = found_.chunk_indexes.back();
  chunk.message_index_length += length;
  if (!newest_chunk_->indexed.insert(index->channel_id).second) {
    return Wrong(offset_, "a second MessageIndex of " + Named("channel", index->channel_id));
  }
  chunk.message_index_offsets[index->channel_id] = offset_;
  std::ranges::sort(index->records);
  const auto messages = newest_chunk_->messages.find(index->channel_id);
  const bool right =
      messages == newest_chunk_->messages.end() ? index->records.empty() : index->records == messages->second;
  if (!right)
    Wrong(offset_, "a MessageIndex of " + Named("channel", index->channel_id) + " disagrees with its chunk");
}

void Checker::EndNewestChunk() {
  const NewestChunk chunk = std::move(*newest_chunk_);
  newest_chunk_.reset();
  if (chunk.indexed.empty()) {
    if (!chunk.messages.empty()) Doubt(chunk.offset, "a chunk without message indexes");
    return;
  }
  for (const auto& [id, entries] : chunk.messages) {
    if (!chunk.indexed.contains(id))
      Wrong(chunk.offset, "a chunk without MessageIndex of " + Named("channel", id));
  }
}

void Checker::VisitAttachment(Bytes content, uint64_t length) {
  ++found_.statistics->attachment_count;
  const auto attachment = Decoded<Attachment>(offset_, content);
  if (!attachment) return;
  if (!CrcAgrees(*attachment, content)) Wrong(offset_, "an attachment's CRC is wrong: it is damaged");
  CheckText(offset_, attachment->name, "an attachment's name");
  CheckText(offset_, attachment->media_type, "an attachment's media type");
  found_.attachment_indexes.push_back({.offset = offset_,
                                       .length = length,
                                       .log_time_ns = attachment->log_time_ns,
                                       .create_time_ns = attachment->create_time_ns,
                                       .data_size = attachment->data.size(),
                                       .name = attachment->name,
                                       .media_type = attachment->media_type});
}

void Checker::VisitMetadata(Bytes content, uint64_t length) {
  ++found_.statistics->metadata_count;
  const auto metadata = Decoded<Metadata>(offset_, content);
  if (!metadata) return;
  CheckText(offset_, metadata->name, "a metadata record's name");
  for (const auto& [key, value] : metadata->metadata) {
    CheckText(offset_, key, "metadata");
    CheckText(offset_, value, "metadata");
  }
  found_.metadata_indexes.push_back({.offset = offset_, .length = length, .name = metadata->name});
}

}  // namespace taclink::mcap

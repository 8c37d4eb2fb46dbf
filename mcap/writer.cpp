#include "mcap/writer.h"

#include <algorithm>
#include <ranges>

#include "mcap/crc32.h"
#include "mcap/summary_writer.h"

namespace taclink::mcap {
namespace {

template <typename T>
Result<uint16_t> AddTo(std::map<uint16_t, T>& all, T record, const char* what) {
  uint32_t next = all.empty() ? 1 : uint32_t{all.rbegin()->first} + 1;
  if (next > UINT16_MAX) {
    for (next = 1; next <= UINT16_MAX && all.contains(static_cast<uint16_t>(next));) ++next;
  }
  if (next > UINT16_MAX) {
    return Error{ErrorCode::kResourceExhausted,
                 std::string("no ") + what + " id from 1 to 65535 is free; write several logs"};
  }
  record.id = static_cast<uint16_t>(next);
  return all.emplace(record.id, std::move(record)).first->first;
}

template <typename T>
Result<void> KeepIn(std::map<uint16_t, T>& all, T record, const char* what) {
  const uint16_t id = record.id;
  const auto [found, added] = all.try_emplace(id, record);
  if (added || found->second == record) return {};
  return Error{ErrorCode::kInvalidArgument,
               std::string(what) + " " + std::to_string(id) + " is there already and is another one"};
}

}  // namespace

Writer::Writer(ByteSink& sink, WriterOptions options)
    : sink_(sink),
      options_(std::move(options)),
      compressor_(options_.compression, options_.level),
      chunk_(options_.chunk_bytes) {}

Result<std::unique_ptr<Writer>> Writer::Create(ByteSink& sink, WriterOptions options) {
  if (options.chunk_bytes > kMaxChunkBytes / 2) {
    return Error{ErrorCode::kInvalidArgument, "chunks of more than " + std::to_string(kMaxChunkBytes / 2) +
                                                  " bytes are refused by readers"};
  }
  if (sink.position() != 0)
    return Error{ErrorCode::kInvalidArgument, "a log begins at the start of its sink"};
  std::unique_ptr<Writer> writer(new Writer(sink, std::move(options)));
  Buffer start(kMagic.begin(), kMagic.end());
  Append(Header{.profile = writer->options_.profile, .library = writer->options_.library}, start);
  const std::array<Bytes, 1> pieces = {start};
  if (const auto handed = writer->Hand(pieces); !handed) return handed.error();
  writer->data_crc_ = writer->CrcOf(start);
  return writer;
}

uint32_t Writer::CrcOf(Bytes bytes, uint32_t before) const {
  return options_.crcs ? Crc32(bytes, before) : 0;
}

Result<uint16_t> Writer::AddSchema(Schema schema) {
  return AddTo(schemas_, std::move(schema), "schema");
}

Result<uint16_t> Writer::AddChannel(Channel channel) {
  if (const auto known = CheckSchemaOf(channel); !known) return known.error();
  return AddTo(channels_, std::move(channel), "channel");
}

Result<void> Writer::KeepSchema(Schema schema) {
  if (schema.id == 0) {
    return Error{
        ErrorCode::kInvalidArgument,
        "schema '" + schema.name + "' has the id 0, which means no schema; let the writer choose one"};
  }
  return KeepIn(schemas_, std::move(schema), "schema");
}

Result<void> Writer::KeepChannel(Channel channel) {
  if (const auto known = CheckSchemaOf(channel); !known) return known;
  return KeepIn(channels_, std::move(channel), "channel");
}

Result<void> Writer::CheckSchemaOf(const Channel& channel) const {
  if (channel.schema_id == 0 || schemas_.contains(channel.schema_id)) return {};
  return Error{ErrorCode::kInvalidArgument, "channel '" + channel.topic + "' names schema " +
                                                std::to_string(channel.schema_id) + ", which is not there"};
}

Result<void> Writer::CheckOpen() const {
  if (closed_) return Error{ErrorCode::kFailedPrecondition, "the log is closed; begin another one"};
  return {};
}

void Writer::Declare(const Channel& channel) {
  const auto missing = [](uint16_t id, const auto& written, auto& open) {
    return !written.contains(id) && open.insert(id).second;
  };
  if (channel.schema_id != 0 && missing(channel.schema_id, written_schemas_, open_schemas_)) {
    chunk_.Add(schemas_.at(channel.schema_id));
  }
  if (missing(channel.id, written_channels_, open_channels_)) chunk_.Add(channel);
}

Result<void> Writer::Write(const Message& message, std::shared_ptr<const void> owner) {
  if (const auto open = CheckOpen(); !open) return open;
  const auto channel = channels_.find(message.channel_id);
  if (channel == channels_.end()) {
    return Error{ErrorCode::kInvalidArgument,
                 "a message names channel " + std::to_string(message.channel_id) + ", which is not there"};
  }
  if (message.data.size() > kMaxChunkBytes / 2) {
    return Error{ErrorCode::kInvalidArgument, "a message of " + std::to_string(message.data.size()) +
                                                  " bytes on '" + channel->second.topic + "' is too large"};
  }
  Declare(channel->second);
  const bool borrow = options_.compression == Compression::kNone;
  chunk_.Add(message, borrow ? std::move(owner) : nullptr);
  return chunk_.size() >= options_.chunk_bytes ? EndChunk() : Result<void>();
}

Result<void> Writer::Hand(std::span<const Bytes> pieces) {
  if (torn_) {
    if (const auto cut = sink_.Truncate(end_); !cut) return cut;
    torn_ = false;
  }
  const auto appended = sink_.Append(pieces);
  if (!appended) {
    torn_ = !sink_.Truncate(end_).ok();
    return appended;
  }
  end_ = sink_.position();
  return {};
}

Result<void> Writer::EndChunk() {
  if (chunk_.empty()) return {};
  const auto handed = HandChunk();
  if (!handed) {
    for (const auto& [id, index] : chunk_.indexes()) {
      if (!index.records.empty()) lost_[id] += index.records.size();
    }
  }
  ForgetChunk();
  return handed;
}

Result<void> Writer::HandChunk() {
  std::vector<Bytes> pieces(1);
  chunk_.AppendPieces(pieces);
  Chunk chunk{.message_start_ns = chunk_.start_ns(),
              .message_end_ns = chunk_.end_ns(),
              .uncompressed_size = chunk_.size(),
              .uncompressed_crc = 0,
              .compression = std::string(NameOf(options_.compression)),
              .records = {}};
  for (size_t i = 1; i < pieces.size(); ++i)
    chunk.uncompressed_crc = CrcOf(pieces[i], chunk.uncompressed_crc);
  uint32_t records_crc = chunk.uncompressed_crc;
  uint64_t records_size = chunk_.size();
  if (options_.compression != Compression::kNone) {
    // Nothing is borrowed then: the records are one piece.
    if (const auto done = compressor_.Compress(pieces.at(1), compressed_); !done) return done;
    pieces[1] = compressed_;
    records_crc = CrcOf(compressed_);
    records_size = compressed_.size();
  }
  scratch_.clear();
  AppendChunkPrefix(chunk, records_size, scratch_);
  const size_t prefix_size = scratch_.size();

  ChunkIndex index = IndexOf(chunk, end_, prefix_size, records_size);
  for (const auto& [id, messages] : chunk_.indexes()) {
    if (messages.records.empty()) continue;
    index.message_index_offsets[id] = end_ + records_size + scratch_.size();
    Append(messages, scratch_);
  }
  index.message_index_length = scratch_.size() - prefix_size;
  pieces.front() = Bytes(scratch_).first(prefix_size);
  pieces.push_back(Bytes(scratch_).subspan(prefix_size));
  if (const auto handed = Hand(pieces); !handed) return handed;
  if (options_.crcs) {
    data_crc_ = Crc32Combine(Crc32(pieces.front(), data_crc_), records_crc, records_size);
    data_crc_ = Crc32(pieces.back(), data_crc_);
  }
  CommitChunk(std::move(index));
  return {};
}

void Writer::CommitChunk(ChunkIndex index) {
  const bool first = statistics_.message_count == 0;
  for (const auto& [id, messages] : chunk_.indexes()) {
    if (!messages.records.empty()) statistics_.channel_message_counts[id] += messages.records.size();
  }
  statistics_.message_count += chunk_.messages();
  statistics_.message_start_ns =
      first ? chunk_.start_ns() : std::min(statistics_.message_start_ns, chunk_.start_ns());
  statistics_.message_end_ns = std::max(statistics_.message_end_ns, chunk_.end_ns());
  ++statistics_.chunk_count;
  written_schemas_.merge(open_schemas_);
  written_channels_.merge(open_channels_);
  chunk_indexes_.push_back(std::move(index));
}

void Writer::ForgetChunk() {
  open_schemas_.clear();
  open_channels_.clear();
  chunk_.Clear();
}

Result<void> Writer::AddAttachment(const Attachment& attachment) {
  if (const auto open = CheckOpen(); !open) return open;
  if (attachment.data.size() > kMaxChunkBytes) {
    return Error{ErrorCode::kInvalidArgument, "attachment '" + attachment.name + "' of " +
                                                  std::to_string(attachment.data.size()) +
                                                  " bytes is too large"};
  }
  scratch_.clear();
  AppendAttachmentPrefix(attachment, scratch_);
  const size_t prefix_size = scratch_.size();
  const uint32_t prefix_crc = CrcOf(Bytes(scratch_).subspan(kRecordHeaderBytes));
  const auto crc = LittleEndian(CrcOf(attachment.data, prefix_crc));
  const std::array<Bytes, 3> pieces = {scratch_, attachment.data, crc};
  const uint64_t offset = end_;
  if (const auto handed = Hand(pieces); !handed) return handed;
  for (const Bytes piece : pieces) data_crc_ = CrcOf(piece, data_crc_);
  ++statistics_.attachment_count;
  attachment_indexes_.push_back({.offset = offset,
                                 .length = prefix_size + attachment.data.size() + crc.size(),
                                 .log_time_ns = attachment.log_time_ns,
                                 .create_time_ns = attachment.create_time_ns,
                                 .data_size = attachment.data.size(),
                                 .name = attachment.name,
                                 .media_type = attachment.media_type});
  return {};
}

Result<void> Writer::AddMetadata(const Metadata& metadata) {
  if (const auto open = CheckOpen(); !open) return open;
  scratch_.clear();
  Append(metadata, scratch_);
  const uint64_t offset = end_;
  const std::array<Bytes, 1> pieces = {scratch_};
  if (const auto handed = Hand(pieces); !handed) return handed;
  data_crc_ = CrcOf(scratch_, data_crc_);
  ++statistics_.metadata_count;
  metadata_indexes_.push_back({.offset = offset, .length = scratch_.size(), .name = metadata.name});
  return {};
}

Result<void> Writer::Flush() {
  if (const auto open = CheckOpen(); !open) return open;
  return EndChunk();
}

Result<void> Writer::Sync() {
  if (const auto flushed = Flush(); !flushed) return flushed;
  return sink_.Sync();
}

Result<void> Writer::Close() {
  if (const auto flushed = Flush(); !flushed) return flushed;
  Buffer end;
  for (const auto& [id, schema] : schemas_) {
    if (!written_schemas_.contains(id)) Append(schema, end);
  }
  for (const auto& [id, channel] : channels_) {
    if (!written_channels_.contains(id)) Append(channel, end);
  }
  Append(DataEnd{.data_section_crc = CrcOf(end, data_crc_)}, end);
  Statistics statistics = statistics_;
  statistics.schema_count = static_cast<uint16_t>(schemas_.size());
  statistics.channel_count = static_cast<uint32_t>(channels_.size());
  SummaryWriter summary(end_, options_.crcs, end);
  summary.Add(Opcode::kSchema, schemas_ | std::views::values);
  summary.Add(Opcode::kChannel, channels_ | std::views::values);
  summary.Add(Opcode::kStatistics, std::span(&statistics, 1));
  summary.Add(Opcode::kChunkIndex, chunk_indexes_);
  summary.Add(Opcode::kAttachmentIndex, attachment_indexes_);
  summary.Add(Opcode::kMetadataIndex, metadata_indexes_);
  summary.Finish();
  const std::array<Bytes, 1> pieces = {end};
  if (const auto handed = Hand(pieces); !handed) return handed;
  statistics_ = std::move(statistics);
  closed_ = true;
  return {};
}

}  // namespace taclink::mcap

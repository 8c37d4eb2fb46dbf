#include "mcap/records.h"

#include <algorithm>

namespace taclink::mcap {
namespace {

/// Appends opcode and length on construction and puts the right length on destruction.
class RecordFrame {
 public:
  RecordFrame(Opcode opcode, Buffer& out) : out_(out) {
    out_.push_back(static_cast<std::byte>(opcode));
    AppendNumber(uint64_t{0}, out_);
    start_ = out_.size();
  }
  ~RecordFrame() { PutNumber(static_cast<uint64_t>(out_.size() - start_ + later_), start_ - 8, out_); }
  RecordFrame(const RecordFrame&) = delete;
  RecordFrame& operator=(const RecordFrame&) = delete;

  /// Bytes of the content that follow elsewhere.
  void Expect(uint64_t bytes) { later_ = bytes; }

 private:
  Buffer& out_;
  size_t start_ = 0;
  uint64_t later_ = 0;
};

/// Appends the byte length of a map or array on destruction.
class SizedFrame {
 public:
  explicit SizedFrame(Buffer& out) : out_(out), start_(out.size() + 4) { AppendNumber(uint32_t{0}, out_); }
  ~SizedFrame() { PutNumber(static_cast<uint32_t>(out_.size() - start_), start_ - 4, out_); }
  SizedFrame(const SizedFrame&) = delete;
  SizedFrame& operator=(const SizedFrame&) = delete;

 private:
  Buffer& out_;
  size_t start_;
};

void AppendMap(const TextMap& map, Buffer& out) {
  const SizedFrame frame(out);
  for (const auto& [key, value] : map) {
    AppendString(key, out);
    AppendString(value, out);
  }
}

void AppendMap(const ChannelMap& map, Buffer& out) {
  const SizedFrame frame(out);
  for (const auto& [key, value] : map) {
    AppendNumber(key, out);
    AppendNumber(value, out);
  }
}

}  // namespace

std::string NameOf(Opcode opcode) {
  static constexpr std::array kNames = {"Header",        "Footer",          "Schema",       "Channel",
                                        "Message",       "Chunk",           "MessageIndex", "ChunkIndex",
                                        "Attachment",    "AttachmentIndex", "Statistics",   "Metadata",
                                        "MetadataIndex", "SummaryOffset",   "DataEnd"};
  if (IsKnown(opcode)) return kNames[static_cast<size_t>(opcode) - 1];
  return "record of type " + std::to_string(static_cast<int>(opcode));
}

void Append(const Header& record, Buffer& out) {
  const RecordFrame frame(Opcode::kHeader, out);
  AppendString(record.profile, out);
  AppendString(record.library, out);
}

void Append(const Footer& record, Buffer& out) {
  const RecordFrame frame(Opcode::kFooter, out);
  AppendNumber(record.summary_start, out);
  AppendNumber(record.summary_offset_start, out);
  AppendNumber(record.summary_crc, out);
}

void Append(const Schema& record, Buffer& out) {
  const RecordFrame frame(Opcode::kSchema, out);
  AppendNumber(record.id, out);
  AppendString(record.name, out);
  AppendString(record.encoding, out);
  AppendString(record.data, out);
}

void Append(const Channel& record, Buffer& out) {
  const RecordFrame frame(Opcode::kChannel, out);
  AppendNumber(record.id, out);
  AppendNumber(record.schema_id, out);
  AppendString(record.topic, out);
  AppendString(record.message_encoding, out);
  AppendMap(record.metadata, out);
}

void AppendMessagePrefix(const Message& record, Buffer& out) {
  out.push_back(static_cast<std::byte>(Opcode::kMessage));
  AppendNumber(kMessagePrefixBytes + record.data.size(), out);
  AppendNumber(record.channel_id, out);
  AppendNumber(record.sequence, out);
  AppendNumber(record.log_time_ns, out);
  AppendNumber(record.publish_time_ns, out);
}

void Append(const Message& record, Buffer& out) {
  AppendMessagePrefix(record, out);
  AppendBytes(record.data, out);
}

void AppendChunkPrefix(const Chunk& record, uint64_t records_size, Buffer& out) {
  RecordFrame frame(Opcode::kChunk, out);
  AppendNumber(record.message_start_ns, out);
  AppendNumber(record.message_end_ns, out);
  AppendNumber(record.uncompressed_size, out);
  AppendNumber(record.uncompressed_crc, out);
  AppendString(record.compression, out);
  AppendNumber(records_size, out);
  frame.Expect(records_size);
}

ChunkIndex IndexOf(const Chunk& chunk, uint64_t offset, uint64_t prefix_size, uint64_t records_size) {
  return {.message_start_ns = chunk.message_start_ns,
          .message_end_ns = chunk.message_end_ns,
          .chunk_start = offset,
          .chunk_length = prefix_size + records_size,
          .message_index_offsets = {},
          .message_index_length = 0,
          .compression = chunk.compression,
          .compressed_size = records_size,
          .uncompressed_size = chunk.uncompressed_size};
}

void Append(const Chunk& record, Buffer& out) {
  AppendChunkPrefix(record, record.records.size(), out);
  AppendBytes(record.records, out);
}

void Append(const MessageIndex& record, Buffer& out) {
  const RecordFrame frame(Opcode::kMessageIndex, out);
  AppendNumber(record.channel_id, out);
  const SizedFrame entries(out);
  for (const auto& [time, offset] : record.records) {
    AppendNumber(time, out);
    AppendNumber(offset, out);
  }
}

void Append(const ChunkIndex& record, Buffer& out) {
  const RecordFrame frame(Opcode::kChunkIndex, out);
  AppendNumber(record.message_start_ns, out);
  AppendNumber(record.message_end_ns, out);
  AppendNumber(record.chunk_start, out);
  AppendNumber(record.chunk_length, out);
  AppendMap(record.message_index_offsets, out);
  AppendNumber(record.message_index_length, out);
  AppendString(record.compression, out);
  AppendNumber(record.compressed_size, out);
  AppendNumber(record.uncompressed_size, out);
}

void AppendAttachmentPrefix(const Attachment& record, Buffer& out) {
  RecordFrame frame(Opcode::kAttachment, out);
  AppendNumber(record.log_time_ns, out);
  AppendNumber(record.create_time_ns, out);
  AppendString(record.name, out);
  AppendString(record.media_type, out);
  AppendNumber(static_cast<uint64_t>(record.data.size()), out);
  frame.Expect(record.data.size() + sizeof(record.crc));
}

void Append(const AttachmentIndex& record, Buffer& out) {
  const RecordFrame frame(Opcode::kAttachmentIndex, out);
  AppendNumber(record.offset, out);
  AppendNumber(record.length, out);
  AppendNumber(record.log_time_ns, out);
  AppendNumber(record.create_time_ns, out);
  AppendNumber(record.data_size, out);
  AppendString(record.name, out);
  AppendString(record.media_type, out);
}

void Append(const Statistics& record, Buffer& out) {
  const RecordFrame frame(Opcode::kStatistics, out);
  AppendNumber(record.message_count, out);
  AppendNumber(record.schema_count, out);
  AppendNumber(record.channel_count, out);
  AppendNumber(record.attachment_count, out);
  AppendNumber(record.metadata_count, out);
  AppendNumber(record.chunk_count, out);
  AppendNumber(record.message_start_ns, out);
  AppendNumber(record.message_end_ns, out);
  AppendMap(record.channel_message_counts, out);
}

void Append(const Metadata& record, Buffer& out) {
  const RecordFrame frame(Opcode::kMetadata, out);
  AppendString(record.name, out);
  AppendMap(record.metadata, out);
}

void Append(const MetadataIndex& record, Buffer& out) {
  const RecordFrame frame(Opcode::kMetadataIndex, out);
  AppendNumber(record.offset, out);
  AppendNumber(record.length, out);
  AppendString(record.name, out);
}

void Append(const SummaryOffset& record, Buffer& out) {
  const RecordFrame frame(Opcode::kSummaryOffset, out);
  out.push_back(static_cast<std::byte>(record.group_opcode));
  AppendNumber(record.group_start, out);
  AppendNumber(record.group_length, out);
}

void Append(const DataEnd& record, Buffer& out) {
  const RecordFrame frame(Opcode::kDataEnd, out);
  AppendNumber(record.data_section_crc, out);
}

}  // namespace taclink::mcap

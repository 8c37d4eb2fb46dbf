#include "mcap/records.h"

namespace taclink::mcap {
namespace {

struct Fields : ByteReader {
  using ByteReader::ByteReader;
  bool wrong = false;  ///< complete, but against the rules

  TextMap Texts() {
    TextMap map;
    Fields entries(Sized<uint32_t>());
    while (!entries.done()) {
      std::string key = entries.String();
      std::string value = entries.String();
      if (!map.emplace(std::move(key), std::move(value)).second) wrong = true;
    }
    if (entries.failed()) wrong = true;
    return map;
  }

  ChannelMap Channels() {
    ChannelMap map;
    Fields entries(Sized<uint32_t>());
    while (!entries.done()) {
      const auto key = entries.Number<uint16_t>();
      const auto value = entries.Number<uint64_t>();
      if (!map.emplace(key, value).second) wrong = true;
    }
    if (entries.failed()) wrong = true;
    return map;
  }
};

template <typename T>
Result<T> Finish(const Fields& in, T record, Opcode opcode) {
  if (in.failed())
    return Error{ErrorCode::kInvalidArgument, NameOf(opcode) + " is cut off or has a wrong length"};
  if (in.wrong) {
    return Error{ErrorCode::kInvalidArgument,
                 NameOf(opcode) + " holds a map that is cut off or has a key twice"};
  }
  return record;
}

}  // namespace

RecordHeader DecodeRecordHeader(Bytes bytes) {
  ByteReader in(bytes);
  const auto opcode = static_cast<Opcode>(in.Number<uint8_t>());
  return {.opcode = opcode, .length = in.Number<uint64_t>()};
}

Result<RawRecord> TakeRecord(Bytes& bytes) {
  if (bytes.size() < kRecordHeaderBytes) {
    return Error{ErrorCode::kInvalidArgument, "a record's header is cut off"};
  }
  const RecordHeader header = DecodeRecordHeader(bytes);
  if (header.length > bytes.size() - kRecordHeaderBytes) {
    return Error{ErrorCode::kInvalidArgument, NameOf(header.opcode) + " of " + std::to_string(header.length) +
                                                  " bytes reaches past the end"};
  }
  const auto length = static_cast<size_t>(header.length);
  const RawRecord record{.opcode = header.opcode, .content = bytes.subspan(kRecordHeaderBytes, length)};
  bytes = bytes.subspan(kRecordHeaderBytes + length);
  return record;
}

// Braced initialisers are evaluated in order, so fields are taken in the order of the specification.

template <>
Result<Header> Decode(Bytes content) {
  Fields in(content);
  Header record{.profile = in.String(), .library = in.String()};
  return Finish(in, std::move(record), Opcode::kHeader);
}

template <>
Result<Footer> Decode(Bytes content) {
  Fields in(content);
  const Footer record{.summary_start = in.Number<uint64_t>(),
                      .summary_offset_start = in.Number<uint64_t>(),
                      .summary_crc = in.Number<uint32_t>()};
  return Finish(in, record, Opcode::kFooter);
}

template <>
Result<Schema> Decode(Bytes content) {
  Fields in(content);
  Schema record{
      .id = in.Number<uint16_t>(), .name = in.String(), .encoding = in.String(), .data = in.String()};
  return Finish(in, std::move(record), Opcode::kSchema);
}

template <>
Result<Channel> Decode(Bytes content) {
  Fields in(content);
  Channel record{.id = in.Number<uint16_t>(),
                 .schema_id = in.Number<uint16_t>(),
                 .topic = in.String(),
                 .message_encoding = in.String(),
                 .metadata = in.Texts()};
  return Finish(in, std::move(record), Opcode::kChannel);
}

template <>
Result<Message> Decode(Bytes content) {
  Fields in(content);
  Message record{.channel_id = in.Number<uint16_t>(),
                 .sequence = in.Number<uint32_t>(),
                 .log_time_ns = in.Number<uint64_t>(),
                 .publish_time_ns = in.Number<uint64_t>(),
                 .data = {}};
  record.data = in.Take(in.remaining());
  return Finish(in, record, Opcode::kMessage);
}

template <>
Result<Chunk> Decode(Bytes content) {
  Fields in(content);
  Chunk record{.message_start_ns = in.Number<uint64_t>(),
               .message_end_ns = in.Number<uint64_t>(),
               .uncompressed_size = in.Number<uint64_t>(),
               .uncompressed_crc = in.Number<uint32_t>(),
               .compression = in.String(),
               .records = in.Sized<uint64_t>()};
  return Finish(in, std::move(record), Opcode::kChunk);
}

template <>
Result<MessageIndex> Decode(Bytes content) {
  Fields in(content);
  MessageIndex record{.channel_id = in.Number<uint16_t>(), .records = {}};
  Fields entries(in.Sized<uint32_t>());
  record.records.reserve(entries.remaining() / 16);
  while (entries.remaining() >= 16) {
    const auto time = entries.Number<uint64_t>();
    record.records.emplace_back(time, entries.Number<uint64_t>());
  }
  if (!entries.done()) in.wrong = true;
  return Finish(in, std::move(record), Opcode::kMessageIndex);
}

template <>
Result<ChunkIndex> Decode(Bytes content) {
  Fields in(content);
  ChunkIndex record{.message_start_ns = in.Number<uint64_t>(),
                    .message_end_ns = in.Number<uint64_t>(),
                    .chunk_start = in.Number<uint64_t>(),
                    .chunk_length = in.Number<uint64_t>(),
                    .message_index_offsets = in.Channels(),
                    .message_index_length = in.Number<uint64_t>(),
                    .compression = in.String(),
                    .compressed_size = in.Number<uint64_t>(),
                    .uncompressed_size = in.Number<uint64_t>()};
  return Finish(in, std::move(record), Opcode::kChunkIndex);
}

template <>
Result<Attachment> Decode(Bytes content) {
  Fields in(content);
  Attachment record{.log_time_ns = in.Number<uint64_t>(),
                    .create_time_ns = in.Number<uint64_t>(),
                    .name = in.String(),
                    .media_type = in.String(),
                    .data = in.Sized<uint64_t>(),
                    .crc = in.Number<uint32_t>()};
  return Finish(in, std::move(record), Opcode::kAttachment);
}

template <>
Result<AttachmentIndex> Decode(Bytes content) {
  Fields in(content);
  AttachmentIndex record{.offset = in.Number<uint64_t>(),
                         .length = in.Number<uint64_t>(),
                         .log_time_ns = in.Number<uint64_t>(),
                         .create_time_ns = in.Number<uint64_t>(),
                         .data_size = in.Number<uint64_t>(),
                         .name = in.String(),
                         .media_type = in.String()};
  return Finish(in, std::move(record), Opcode::kAttachmentIndex);
}

template <>
Result<Statistics> Decode(Bytes content) {
  Fields in(content);
  Statistics record{.message_count = in.Number<uint64_t>(),
                    .schema_count = in.Number<uint16_t>(),
                    .channel_count = in.Number<uint32_t>(),
                    .attachment_count = in.Number<uint32_t>(),
                    .metadata_count = in.Number<uint32_t>(),
                    .chunk_count = in.Number<uint32_t>(),
                    .message_start_ns = in.Number<uint64_t>(),
                    .message_end_ns = in.Number<uint64_t>(),
                    .channel_message_counts = in.Channels()};
  return Finish(in, std::move(record), Opcode::kStatistics);
}

template <>
Result<Metadata> Decode(Bytes content) {
  Fields in(content);
  Metadata record{.name = in.String(), .metadata = in.Texts()};
  return Finish(in, std::move(record), Opcode::kMetadata);
}

template <>
Result<MetadataIndex> Decode(Bytes content) {
  Fields in(content);
  MetadataIndex record{.offset = in.Number<uint64_t>(), .length = in.Number<uint64_t>(), .name = in.String()};
  return Finish(in, std::move(record), Opcode::kMetadataIndex);
}

template <>
Result<SummaryOffset> Decode(Bytes content) {
  Fields in(content);
  const SummaryOffset record{.group_opcode = static_cast<Opcode>(in.Number<uint8_t>()),
                             .group_start = in.Number<uint64_t>(),
                             .group_length = in.Number<uint64_t>()};
  return Finish(in, record, Opcode::kSummaryOffset);
}

template <>
Result<DataEnd> Decode(Bytes content) {
  Fields in(content);
  const DataEnd record{.data_section_crc = in.Number<uint32_t>()};
  return Finish(in, record, Opcode::kDataEnd);
}

}  // namespace taclink::mcap

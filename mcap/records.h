#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "mcap/bytes.h"
#include "sensing/core/result.h"

/// The records of the MCAP log format, version 0 [mcap]. Times are ns since an epoch that the user
/// of the log knows; offsets and lengths are bytes, offsets from the start of the file unless said otherwise.
namespace taclink::mcap {

inline constexpr std::array<std::byte, 8> kMagic = {std::byte{0x89}, std::byte{'M'}, std::byte{'C'},
                                                    std::byte{'A'},  std::byte{'P'}, std::byte{'0'},
                                                    std::byte{'\r'}, std::byte{'\n'}};
inline constexpr uint64_t kRecordHeaderBytes = 9;    ///< opcode and length before each record's content
inline constexpr uint64_t kMessagePrefixBytes = 22;  ///< of a message's content, before its data
inline constexpr uint64_t kFooterBytes = 20;
/// The largest uncompressed chunk that is written, and by default read.
inline constexpr uint64_t kMaxChunkBytes = uint64_t{256} << 20;

enum class Opcode : uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};
inline bool IsKnown(Opcode opcode) {
  return opcode >= Opcode::kHeader && opcode <= Opcode::kDataEnd;
}
/// "Chunk", "MessageIndex"; for an unknown one its number.
std::string NameOf(Opcode opcode);

using TextMap = std::map<std::string, std::string>;
using ChannelMap = std::map<uint16_t, uint64_t>;  ///< by channel id

struct Header {
  std::string profile = {};
  std::string library = {};
  bool operator==(const Header&) const = default;
};

struct Footer {
  uint64_t summary_start = 0;         ///< 0: there is no summary
  uint64_t summary_offset_start = 0;  ///< 0: there are no summary offsets
  uint32_t summary_crc = 0;           ///< from summary_start to before this field; 0: none
  bool operator==(const Footer&) const = default;
};

struct Schema {
  uint16_t id = 0;  ///< not 0 in a file
  std::string name = {};
  std::string encoding = {};
  std::string data = {};
  bool operator==(const Schema&) const = default;
};

struct Channel {
  uint16_t id = 0;
  uint16_t schema_id = 0;  ///< 0: no schema
  std::string topic = {};
  std::string message_encoding = {};
  TextMap metadata = {};
  bool operator==(const Channel&) const = default;
};

/// `data` is borrowed.
struct Message {
  uint16_t channel_id = 0;
  uint32_t sequence = 0;
  uint64_t log_time_ns = 0;
  uint64_t publish_time_ns = 0;
  Bytes data = {};
};

/// `records` are borrowed.
struct Chunk {
  uint64_t message_start_ns = 0;
  uint64_t message_end_ns = 0;
  uint64_t uncompressed_size = 0;
  uint32_t uncompressed_crc = 0;  ///< 0: none
  std::string compression = {};   ///< "", "zstd", "lz4"
  Bytes records = {};
};

struct MessageIndex {
  uint16_t channel_id = 0;
  std::vector<std::pair<uint64_t, uint64_t>> records = {};  ///< log time, offset in the uncompressed chunk
  bool operator==(const MessageIndex&) const = default;
};

struct ChunkIndex {
  uint64_t message_start_ns = 0;
  uint64_t message_end_ns = 0;
  uint64_t chunk_start = 0;
  uint64_t chunk_length = 0;  ///< of the whole record
  ChannelMap message_index_offsets = {};
  uint64_t message_index_length = 0;
  std::string compression = {};
  uint64_t compressed_size = 0;
  uint64_t uncompressed_size = 0;
  bool operator==(const ChunkIndex&) const = default;
};

/// `data` is borrowed.
struct Attachment {
  uint64_t log_time_ns = 0;
  uint64_t create_time_ns = 0;  ///< 0: not known
  std::string name = {};
  std::string media_type = {};
  Bytes data = {};
  uint32_t crc = 0;  ///< of all before it; 0: none. AppendAttachmentPrefix's caller appends it
};

struct AttachmentIndex {
  uint64_t offset = 0;
  uint64_t length = 0;  ///< of the whole record
  uint64_t log_time_ns = 0;
  uint64_t create_time_ns = 0;
  uint64_t data_size = 0;
  std::string name = {};
  std::string media_type = {};
  bool operator==(const AttachmentIndex&) const = default;
};

struct Statistics {
  uint64_t message_count = 0;
  uint16_t schema_count = 0;
  uint32_t channel_count = 0;
  uint32_t attachment_count = 0;
  uint32_t metadata_count = 0;
  uint32_t chunk_count = 0;
  uint64_t message_start_ns = 0;
  uint64_t message_end_ns = 0;
  ChannelMap channel_message_counts = {};
  bool operator==(const Statistics&) const = default;
};

struct Metadata {
  std::string name = {};
  TextMap metadata = {};
  bool operator==(const Metadata&) const = default;
};

struct MetadataIndex {
  uint64_t offset = 0;
  uint64_t length = 0;  ///< of the whole record
  std::string name = {};
  bool operator==(const MetadataIndex&) const = default;
};

struct SummaryOffset {
  Opcode group_opcode{};
  uint64_t group_start = 0;
  uint64_t group_length = 0;
  bool operator==(const SummaryOffset&) const = default;
};

struct DataEnd {
  uint32_t data_section_crc = 0;  ///< of all before this record; 0: none
  bool operator==(const DataEnd&) const = default;
};

/// Append a whole record: opcode, length, content. Strings and maps must be shorter than 4 GiB.
void Append(const Header& record, Buffer& out);
void Append(const Footer& record, Buffer& out);
void Append(const Schema& record, Buffer& out);
void Append(const Channel& record, Buffer& out);
void Append(const Message& record, Buffer& out);
void Append(const Chunk& record, Buffer& out);
void Append(const MessageIndex& record, Buffer& out);
void Append(const ChunkIndex& record, Buffer& out);
void Append(const AttachmentIndex& record, Buffer& out);
void Append(const Statistics& record, Buffer& out);
void Append(const Metadata& record, Buffer& out);
void Append(const MetadataIndex& record, Buffer& out);
void Append(const SummaryOffset& record, Buffer& out);
void Append(const DataEnd& record, Buffer& out);

/// Append a record up to its large bytes, which follow elsewhere. After an attachment's data comes its CRC.
void AppendMessagePrefix(const Message& record, Buffer& out);
void AppendChunkPrefix(const Chunk& record, uint64_t records_size, Buffer& out);
void AppendAttachmentPrefix(const Attachment& record, Buffer& out);

/// The index of a chunk record of `prefix_size` bytes and then its `records_size` bytes of records, at
/// `offset`; without its message indexes.
ChunkIndex IndexOf(const Chunk& chunk, uint64_t offset, uint64_t prefix_size, uint64_t records_size);

/// What stands before each record.
struct RecordHeader {
  Opcode opcode{};
  uint64_t length = 0;  ///< of the content
};
/// `bytes` are at least kRecordHeaderBytes.
RecordHeader DecodeRecordHeader(Bytes bytes);

/// Decodes a record's content; fields added at its end by later versions are ignored. T: any of the above.
/// Errors: kInvalidArgument (cut off, lengths that disagree, a key twice in a map).
template <typename T>
Result<T> Decode(Bytes content);

/// One record at the front of `bytes`, which is left after it.
struct RawRecord {
  Opcode opcode{};
  Bytes content = {};
};
/// Errors: kInvalidArgument (cut off).
Result<RawRecord> TakeRecord(Bytes& bytes);

}  // namespace taclink::mcap

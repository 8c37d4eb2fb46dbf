#include "mcap/load.h"

#include <array>

#include "mcap/compression.h"
#include "mcap/crc32.h"

namespace taclink::mcap {

Error At(uint64_t offset, Error error) {
  error.message = "offset " + std::to_string(offset) + ": " + error.message;
  return error;
}

Result<RawRecord> ReadRecord(const ByteSource& source, uint64_t offset, const Limits& limits,
                             Buffer& buffer) {
  std::array<std::byte, kRecordHeaderBytes> start{};
  if (const auto read = source.Read(offset, start); !read) return read.error();
  const RecordHeader header = DecodeRecordHeader(start);
  const uint64_t content = offset + kRecordHeaderBytes;
  if (header.length > source.size() - content) {
    return At(offset,
              NameOf(header.opcode) + " of " + std::to_string(header.length) + " bytes reaches past the end");
  }
  if (header.length > limits.record_bytes) {
    return At(offset, Error{ErrorCode::kResourceExhausted,
                            NameOf(header.opcode) + " of " + std::to_string(header.length) +
                                " bytes is above the limit of " + std::to_string(limits.record_bytes)});
  }
  buffer.resize(static_cast<size_t>(header.length));
  if (const auto read = source.Read(content, buffer); !read) return read.error();
  return RawRecord{.opcode = header.opcode, .content = buffer};
}

Result<Bytes> LoadChunk(const Chunk& chunk, const Limits& limits, Buffer& buffer) {
  if (chunk.uncompressed_size > limits.chunk_bytes) {
    return Error{ErrorCode::kResourceExhausted, "a chunk of " + std::to_string(chunk.uncompressed_size) +
                                                    " bytes is above the limit of " +
                                                    std::to_string(limits.chunk_bytes)};
  }
  const auto compression = CompressionFrom(chunk.compression);
  if (!compression) return compression.error();
  Bytes records = chunk.records;
  if (*compression != Compression::kNone) {
    const auto done = Decompress(*compression, chunk.records, chunk.uncompressed_size, buffer);
    if (!done) return done.error();
    records = buffer;
  } else if (records.size() != chunk.uncompressed_size) {
    return Error{ErrorCode::kInvalidArgument, "an uncompressed chunk is not of its own size"};
  }
  if (chunk.uncompressed_crc != 0 && Crc32(records) != chunk.uncompressed_crc) {
    return Error{ErrorCode::kInvalidArgument, "a chunk's CRC is wrong: it is damaged"};
  }
  return records;
}

bool CrcAgrees(const Attachment& attachment, Bytes content) {
  const auto before_crc =
      static_cast<size_t>(attachment.data.data() - content.data()) + attachment.data.size();
  return attachment.crc == 0 || Crc32(content.first(before_crc)) == attachment.crc;
}

}  // namespace taclink::mcap

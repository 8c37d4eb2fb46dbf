#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "mcap/byte_source.h"
#include "mcap/records.h"

namespace taclink::mcap {

/// What a reader takes memory for, bytes. Sizes that a file claims are checked against these and against what
/// the file can hold before any memory is taken.
struct Limits {
  uint64_t record_bytes = kMaxChunkBytes + (uint64_t{1} << 20);  ///< of one record, as it is in the file
  uint64_t chunk_bytes = kMaxChunkBytes;                         ///< of one chunk, uncompressed
  uint64_t open_bytes = uint64_t{1} << 30;                       ///< of all chunks that a cursor merges
};

/// `error` with "offset 123: " before its message.
Error At(uint64_t offset, Error error);
inline Error At(uint64_t offset, std::string what) {
  return At(offset, Error{ErrorCode::kInvalidArgument, std::move(what)});
}

/// Reads the record at `offset` into `buffer`. Errors: kInvalidArgument (it is none), kResourceExhausted
/// (above the limit), or the source's.
Result<RawRecord> ReadRecord(const ByteSource& source, uint64_t offset, const Limits& limits, Buffer& buffer);

/// The same, decoded; T's record must be of that type.
template <typename T>
Result<T> ReadRecordAs(const ByteSource& source, Opcode opcode, uint64_t offset, const Limits& limits,
                       Buffer& buffer) {
  const auto record = ReadRecord(source, offset, limits, buffer);
  if (!record) return record.error();
  if (record->opcode != opcode) {
    return At(offset, "here is a " + NameOf(record->opcode) + ", not a " + NameOf(opcode));
  }
  auto decoded = Decode<T>(record->content);
  if (!decoded) return At(offset, decoded.error());
  return decoded;
}

/// A chunk's records, uncompressed and checked against its size and CRC: in `buffer`, or where they are.
/// Errors: kInvalidArgument (damaged), kUnsupported (compression), kResourceExhausted (above the limit).
Result<Bytes> LoadChunk(const Chunk& chunk, const Limits& limits, Buffer& buffer);

/// Whether an attachment record's content agrees with its CRC, or has none.
bool CrcAgrees(const Attachment& attachment, Bytes content);

}  // namespace taclink::mcap

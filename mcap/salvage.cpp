// What damage has spared: chunks whose own fields or length are damaged, but whose records are not.
#include <algorithm>
#include <array>
#include <span>
#include <string_view>

#include "mcap/compression.h"
#include "mcap/crc32.h"
#include "mcap/scanner.h"

namespace taclink::mcap {
namespace {

// A chunk's content: start and end time, size (8 bytes each), CRC, length of the compression's name (4 each),
// the name, length of the records (8), records.
constexpr uint64_t kSizeAt = 16, kCrcAt = 24, kNameAt = 32;
constexpr uint64_t kCrcToRecords = 4 + 4 + 8;  // and the name
constexpr uint64_t kPlainHeadBytes = kNameAt + 8;
constexpr size_t kMagicBytes = 4;

/// A frame of a compression begins with these (RFC 8878; LZ4 frame format 1.6).
struct FrameMagic {
  Compression compression;
  std::array<std::byte, kMagicBytes> bytes;
};
constexpr std::array<FrameMagic, 2> kFrames = {{
    {Compression::kZstd, {std::byte{0x28}, std::byte{0xb5}, std::byte{0x2f}, std::byte{0xfd}}},
    {Compression::kLz4, {std::byte{0x04}, std::byte{0x22}, std::byte{0x4d}, std::byte{0x18}}},
}};

const FrameMagic* FrameAt(Bytes bytes) {
  const auto at = std::ranges::find_if(kFrames, [&](const FrameMagic& frame) {
    return std::ranges::equal(bytes.first(kMagicBytes), frame.bytes);
  });
  return at == kFrames.end() ? nullptr : at;
}

}  // namespace

template <typename T>
std::optional<T> Scanner::NumberAt(uint64_t offset) {
  if (offset > source_.size() || source_.size() - offset < sizeof(T)) return std::nullopt;
  const auto bytes = look_.Get(offset, sizeof(T));
  if (!bytes) return std::nullopt;
  return ByteReader(*bytes).Number<T>();
}

Result<void> Scanner::TakeDamage(uint64_t from, const std::string& why) {
  const uint64_t to = offset_;
  while (from < to) {
    const auto frame = FindFrame(from, to);
    if (!frame) return frame.error();
    report_.dropped += frame->dropped;
    SkipDamage(from, frame->begin, why);
    if (frame->begin == to) return {};
    const auto taken = TakeSalvaged({.offset = frame->begin,
                                     .length = frame->end - frame->begin,
                                     .in_chunk = true,
                                     .verified = frame->verified});
    if (!taken) return taken;
    from = frame->end;
  }
  offset_ = std::max(from, to);  // a length that is too short has cut the frame
  return {};
}

Result<Scanner::Frame> Scanner::FindFrame(uint64_t from, uint64_t to) {
  Frame frame{.begin = to, .end = to};
  for (uint64_t at = from; at + kMagicBytes <= to;) {
    const auto bytes = look_.Get(at, static_cast<size_t>(std::min<uint64_t>(to - at, Window::kBytes)));
    if (!bytes) return bytes.error();
    size_t i = 0;
    while (i + kMagicBytes <= bytes->size() && FrameAt(bytes->subspan(i)) == nullptr) ++i;
    at += i;
    if (i + kMagicBytes > bytes->size()) continue;
    const auto length = LoadFrame(at, frame.verified);
    if (!length) return length.error();
    if (*length > 0 && (frame.verified || options_.keep_unverified)) {
      frame.begin = at;
      frame.end = at + *length;
      return frame;
    }
    if (*length > 0) frame.dropped += CountMessages(chunk_);
    at += std::max<uint64_t>(*length, 1);
  }
  return frame;
}

// Its records into chunk_. Returns its length; 0: there is none. Only behind its compression's name, as in a
// chunk, and read in growing pieces: else damage that is full of frames' beginnings would be read for ever.
Result<uint64_t> Scanner::LoadFrame(uint64_t begin, bool& verified) {
  const auto magic = look_.Get(begin, kMagicBytes);
  if (!magic) return magic.error();
  const Compression compression = FrameAt(*magic)->compression;
  const std::string_view name = NameOf(compression);
  if (begin < kCrcToRecords + name.size()) return uint64_t{0};
  const auto head = look_.Get(begin - 8 - name.size(), name.size());
  if (!head) return head.error();
  if (!std::ranges::equal(*head, std::as_bytes(std::span(name)))) return uint64_t{0};
  const uint64_t most = std::min(source_.size() - begin, options_.limits.record_bytes);
  for (uint64_t size = Window::kBytes;; size *= 2) {
    salvaged_.resize(static_cast<size_t>(std::min(size, most)));
    if (const auto read = source_.Read(begin, salvaged_); !read) return read.error();
    const auto length = DecompressFrame(compression, salvaged_, options_.limits.chunk_bytes, chunk_);
    if (!length && (size >= most || length.error().code != ErrorCode::kUnavailable)) return uint64_t{0};
    if (!length) continue;
    const auto crc = NumberAt<uint32_t>(begin - kCrcToRecords - name.size());
    verified = crc && *crc != 0 && Crc32(chunk_) == *crc;
    return uint64_t{*length};
  }
}

// An uncompressed chunk at offset_: the CRC tells which of the lengths that say so is right. Its records into
// chunk_; none: none is.
Result<std::optional<uint64_t>> Scanner::FindSparedChunk() {
  const uint64_t content = offset_ + kRecordHeaderBytes, records = content + kPlainHeadBytes;
  const bool is_chunk = NumberAt<uint8_t>(offset_) == static_cast<uint8_t>(Opcode::kChunk);
  // Of another type it must agree with itself, or any record would cost a checksum.
  if (!is_chunk && NumberAt<uint64_t>(content + kSizeAt) != NumberAt<uint64_t>(content + kNameAt))
    return std::optional<uint64_t>();
  if (NumberAt<uint32_t>(content + kNameAt - 4) != 0u) return std::optional<uint64_t>();
  const auto crc = NumberAt<uint32_t>(content + kCrcAt);
  if (!crc || *crc == 0 || records > source_.size()) return std::optional<uint64_t>();
  const auto of_record = NumberAt<uint64_t>(offset_ + 1);
  for (const auto size : {NumberAt<uint64_t>(content + kSizeAt), NumberAt<uint64_t>(content + kNameAt),
                          of_record ? std::optional(*of_record - kPlainHeadBytes) : std::nullopt}) {
    if (!size || *size > options_.limits.chunk_bytes || *size > source_.size() - records) continue;
    chunk_.resize(static_cast<size_t>(*size));
    if (const auto read = source_.Read(records, chunk_); !read) return read.error();
    if (Crc32(chunk_) == *crc) return size;
  }
  return std::optional<uint64_t>();
}

Result<void> Scanner::HidesChunk(const Place& place) {
  const auto spared = FindSparedChunk();
  if (!spared) return spared.error();
  const auto frame = *spared ? Result<Frame>(Frame{}) : FindFrame(place.offset, place.end);
  if (!frame) return frame.error();
  if (*spared || (frame->verified && frame->begin < place.end))
    return At(place.offset, "a chunk of a wrong type");
  return {};
}

// True: there was one, and offset_ is behind it.
Result<bool> Scanner::TakeSparedChunk() {
  const auto size = FindSparedChunk();
  if (!size) return size.error();
  if (!*size) return false;
  const uint64_t records = offset_ + kRecordHeaderBytes + kPlainHeadBytes;
  const auto taken = TakeSalvaged({.offset = records, .length = **size, .in_chunk = true, .verified = true});
  if (!taken) return taken.error();
  SkipDamage(offset_, records, "a damaged head of a chunk");
  resume_.reset();
  offset_ = records + **size;
  return true;
}

// The records in chunk_.
Result<void> Scanner::TakeSalvaged(const MessagePlace& place) {
  has_chunks_ = true;
  ++report_.salvaged_chunks;
  ChunkIndex index;
  const auto parsed = TakeChunkRecords(chunk_, place, index);
  return parsed ? Result<void>() : parsed.error();
}

}  // namespace taclink::mcap

#include "mcap/records.h"

#include <gtest/gtest.h>

#include <random>

#include "mcap/compression.h"
#include "mcap/crc32.h"
#include "mcap/load.h"

namespace taclink::mcap {
namespace {

/// The content of the record that `record` is encoded as.
template <typename T>
Buffer ContentOf(const T& record, Opcode opcode) {
  Buffer bytes;
  Append(record, bytes);
  Bytes rest = bytes;
  const auto raw = TakeRecord(rest);
  EXPECT_TRUE(raw.ok() && rest.empty());
  EXPECT_EQ(raw->opcode, opcode);
  return {raw->content.begin(), raw->content.end()};
}

template <typename T>
void ExpectRoundTrip(const T& record, Opcode opcode) {
  Buffer content = ContentOf(record, opcode);
  const auto decoded = Decode<T>(content);
  ASSERT_TRUE(decoded.ok()) << NameOf(opcode);
  EXPECT_EQ(*decoded, record) << NameOf(opcode);
  for (size_t size = 0; size < content.size(); ++size) {
    EXPECT_FALSE(Decode<T>(Bytes(content).first(size)).ok()) << NameOf(opcode) << " of " << size;
  }
  content.push_back(std::byte{7});  // a field of a later version
  EXPECT_TRUE(Decode<T>(content).ok());
}

TEST(McapRecords, RoundTripAndRefuseWhatIsCutOff) {
  ExpectRoundTrip(Header{"ros2", "lib"}, Opcode::kHeader);
  ExpectRoundTrip(Footer{1, 2, 3}, Opcode::kFooter);
  ExpectRoundTrip(Schema{1, "n", "protobuf", std::string("\0d", 2)}, Opcode::kSchema);
  ExpectRoundTrip(Channel{1, 2, "/t", "protobuf", {{"a", "b"}, {"c", ""}}}, Opcode::kChannel);
  ExpectRoundTrip(MessageIndex{3, {{1, 2}, {3, 4}}}, Opcode::kMessageIndex);
  ExpectRoundTrip(ChunkIndex{1, 2, 3, 4, {{5, 6}}, 7, "zstd", 8, 9}, Opcode::kChunkIndex);
  ExpectRoundTrip(AttachmentIndex{1, 2, 3, 4, 5, "n", "m"}, Opcode::kAttachmentIndex);
  ExpectRoundTrip(Statistics{1, 2, 3, 4, 5, 6, 7, 8, {{1, 2}}}, Opcode::kStatistics);
  ExpectRoundTrip(Metadata{"n", {{"a", "b"}}}, Opcode::kMetadata);
  ExpectRoundTrip(MetadataIndex{1, 2, "n"}, Opcode::kMetadataIndex);
  ExpectRoundTrip(SummaryOffset{Opcode::kSchema, 1, 2}, Opcode::kSummaryOffset);
  ExpectRoundTrip(DataEnd{0xDEADBEEF}, Opcode::kDataEnd);
}

TEST(McapRecords, BytesAreThoseOfTheSpecification) {
  Buffer bytes;
  Append(Message{.channel_id = 0x0102,
                 .sequence = 0x03040506,
                 .log_time_ns = 0x0708090A0B0C0D0E,
                 .publish_time_ns = 1,
                 .data = AsBytes("hi")},
         bytes);
  const std::string expected(
      "\x05\x18\0\0\0\0\0\0\0\x02\x01\x06\x05\x04\x03\x0E\x0D\x0C\x0B\x0A\x09\x08\x07\x01\0\0\0\0\0\0\0hi",
      33);
  EXPECT_EQ(AsText(bytes), expected);
}

TEST(McapRecords, RefuseAKeyTwice) {
  Buffer content = ContentOf(Metadata{"n", {{"a", "b"}, {"c", "d"}}}, Opcode::kMetadata);
  *std::find(content.begin(), content.end(), std::byte{'c'}) = std::byte{'a'};
  EXPECT_FALSE(Decode<Metadata>(content).ok());
}

TEST(McapCrc, AgreesWithPublishedValues) {
  // The check value of CRC-32/ISO-HDLC.
  EXPECT_EQ(Crc32(AsBytes("123456789")), 0xCBF43926);
  EXPECT_EQ(Crc32(AsBytes("56789"), Crc32(AsBytes("1234"))), 0xCBF43926);
  EXPECT_EQ(Crc32({}, 5), 5U);
}

TEST(McapCrc, CombinesRuns) {
  std::mt19937 random(3);
  Buffer bytes(100'000);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  for (const size_t cut : {size_t{0}, size_t{1}, size_t{4095}, size_t{65536}, bytes.size()}) {
    const Bytes first = Bytes(bytes).first(cut);
    const Bytes second = Bytes(bytes).subspan(cut);
    EXPECT_EQ(Crc32Combine(Crc32(first), Crc32(second), second.size()), Crc32(bytes)) << cut;
  }
}

TEST(McapCompression, GivesBackTheBytesAndRefusesAnotherSize) {
  const std::string text = std::string(100'000, 'a') + "tail";
  for (const auto compression : {Compression::kNone, Compression::kZstd, Compression::kLz4}) {
    Buffer packed;
    Buffer out;
    ASSERT_TRUE(Compressor(compression, 0).Compress(AsBytes(text), packed).ok());
    ASSERT_TRUE(Decompress(compression, packed, text.size(), out).ok());
    EXPECT_EQ(AsText(out), text);
    EXPECT_FALSE(Decompress(compression, packed, text.size() - 1, out).ok());
    EXPECT_FALSE(Decompress(compression, packed, text.size() + 1, out).ok());
    EXPECT_FALSE(Decompress(compression, Bytes(packed).first(packed.size() - 1), text.size(), out).ok());
  }
  EXPECT_EQ(CompressionFrom("bz2").error().code, ErrorCode::kUnsupported);
}

TEST(McapCompression, TakesNoMemoryForSizesThatCantBe) {
  Buffer packed;
  ASSERT_TRUE(Compressor(Compression::kZstd, 0).Compress(AsBytes("abc"), packed).ok());
  Buffer out;
  EXPECT_FALSE(Decompress(Compression::kZstd, packed, uint64_t{1} << 60, out).ok());
  EXPECT_FALSE(Decompress(Compression::kLz4, packed, uint64_t{1} << 60, out).ok());
  EXPECT_EQ(out.capacity(), 0U);
  const Chunk chunk{.uncompressed_size = 1000, .compression = "zstd", .records = packed};
  EXPECT_EQ(LoadChunk(chunk, {.chunk_bytes = 999}, out).error().code, ErrorCode::kResourceExhausted);
  EXPECT_EQ(out.capacity(), 0U);
}

}  // namespace
}  // namespace taclink::mcap

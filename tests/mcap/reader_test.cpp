#include "mcap/reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <ranges>

#include "mcap/summary_writer.h"
#include "tests/mcap/log_content.h"

namespace taclink::mcap {
namespace {

using ::testing::AllOf;
using testing::AsOthersWrite;
using testing::FindingsOf;
using testing::ForeignForm;
using ::testing::HasSubstr;
using testing::kForeignForms;
using testing::LogContent;
using testing::RandomLogBytes;
using testing::ReadAll;
using testing::StoredMessage;

std::vector<uint32_t> Sequences(const Reader& reader, CursorOptions options, uint64_t* blocks = nullptr) {
  MessageCursor cursor(reader, std::move(options));
  std::vector<uint32_t> out;
  for (auto message = cursor.Next(); message.ok(); message = cursor.Next()) out.push_back(message->sequence);
  if (blocks != nullptr) *blocks = cursor.blocks_read();
  return out;
}

std::unique_ptr<Reader> Open(Bytes bytes, Limits limits = {}) {
  auto reader = Reader::Open(std::make_shared<MemorySource>(bytes), limits);
  EXPECT_TRUE(reader.ok()) << reader.error().message;
  return std::move(*reader);
}

/// One chunk for each list of log times; sequences count from 1. Channels 1 and 2 in turn by chunk.
Buffer ChunksOf(const std::vector<std::vector<uint64_t>>& chunks,
                Compression compression = Compression::kNone) {
  BufferSink sink;
  const auto writer = std::move(*Writer::Create(sink, {.compression = compression}));
  const std::array ids = {*writer->AddChannel({.topic = "a"}), *writer->AddChannel({.topic = "b"})};
  uint32_t sequence = 0;
  size_t index = 0;
  for (const auto& times : chunks) {
    for (const uint64_t time : times) {
      (void)writer->Write({.channel_id = ids[index % 2],
                           .sequence = ++sequence,
                           .log_time_ns = time,
                           .data = AsBytes("data")});
    }
    (void)writer->Flush();
    ++index;
  }
  (void)writer->Close();
  return sink.bytes();
}

using Numbers = std::vector<uint32_t>;

TEST(McapCursor, MergesOverlappingChunksTiesAsInTheFile) {
  const Buffer bytes = ChunksOf({{5, 1, 9}, {2, 5, 3}, {20}, {0, 30}, {5}});
  const auto reader = Open(bytes);
  EXPECT_FALSE(reader->scan()) << reader->summary_problem();
  EXPECT_EQ(Sequences(*reader, {}), (Numbers{8, 2, 4, 6, 1, 5, 10, 3, 7, 9}));
  EXPECT_EQ(Sequences(*reader, {.order = MessageOrder::kReverseLogTime}),
            (Numbers{9, 7, 3, 10, 5, 1, 6, 4, 2, 8}));
  EXPECT_EQ(Sequences(*reader, {.order = MessageOrder::kFile}), (Numbers{1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
}

TEST(McapCursor, TakesRangesAndChannelsAndReadsOnlyTheirChunks) {
  const Buffer bytes = ChunksOf({{1, 2}, {3, 4}, {5, 6}, {7, 8}});
  const auto reader = Open(bytes);
  uint64_t blocks = 0;
  EXPECT_EQ(Sequences(*reader, {.start_ns = 4, .end_ns = 5}, &blocks), (Numbers{4, 5}));
  EXPECT_EQ(blocks, 2U);
  EXPECT_EQ(Sequences(*reader, {.channels = std::set<uint16_t>{2}}, &blocks), (Numbers{3, 4, 7, 8}));
  EXPECT_EQ(blocks, 2U);
  EXPECT_EQ(Sequences(*reader, {.start_ns = 9}, &blocks), Numbers());
  EXPECT_EQ(blocks, 0U);
  EXPECT_EQ(Sequences(*reader, {.channels = std::set<uint16_t>{}}), Numbers());
}

TEST(McapCursor, RandomLogsComeInOrder) {
  for (uint32_t seed = 100; seed < 120; ++seed) {
    LogContent written;
    const Buffer bytes = RandomLogBytes({.seed = seed, .options = {.chunk_bytes = 2000}}, &written);
    std::ranges::stable_sort(written.messages, {}, &StoredMessage::log_time_ns);
    std::string error;
    EXPECT_EQ(ReadAll(bytes, &error, MessageOrder::kLogTime).messages, written.messages) << error;
    std::ranges::reverse(written.messages);
    EXPECT_EQ(ReadAll(bytes, &error, MessageOrder::kReverseLogTime).messages, written.messages) << error;
  }
}

TEST(McapCursor, ADamagedChunkIsNamedAndTheRestIsRead) {
  Buffer bytes = ChunksOf({{1, 2}, {3, 4}, {5, 6}});
  const uint64_t damaged = Open(bytes)->chunk_indexes()[1].chunk_start;
  bytes[damaged + Open(bytes)->chunk_indexes()[1].chunk_length - 1] ^= std::byte{1};
  const auto reader = Open(bytes);
  MessageCursor cursor(*reader, {});
  Numbers found;
  std::string trouble;
  while (true) {
    const auto message = cursor.Next();
    if (message.ok()) {
      found.push_back(message->sequence);
    } else if (message.error().code == ErrorCode::kEndOfData) {
      break;
    } else {
      trouble = message.error().message;
    }
  }
  EXPECT_EQ(found, (Numbers{1, 2, 5, 6}));
  EXPECT_THAT(trouble, HasSubstr("offset " + std::to_string(damaged) + ": "));
  EXPECT_THAT(trouble, HasSubstr("CRC"));
}

TEST(McapCursor, KeepsWithinItsLimits) {
  const Buffer bytes = ChunksOf({{1, 9}, {2, 8}, {3, 7}}, Compression::kZstd);
  const auto few = Open(bytes, {.chunk_bytes = 10});
  EXPECT_EQ(MessageCursor(*few, {}).Next().error().code, ErrorCode::kResourceExhausted);
  const auto overlapping = Open(bytes, {.open_bytes = 200});
  MessageCursor cursor(*overlapping, {});
  ASSERT_TRUE(cursor.Next().ok());
  const auto second = cursor.Next();
  EXPECT_TRUE(second.ok() || second.error().code == ErrorCode::kResourceExhausted);
  EXPECT_EQ(Sequences(*overlapping, {.order = MessageOrder::kFile}).size(), 6U);
}

/// Counts what is read.
class CountingSource : public MemorySource {
 public:
  using MemorySource::MemorySource;
  Result<void> Read(uint64_t offset, std::span<std::byte> out) const override {
    read_ += out.size();
    return MemorySource::Read(offset, out);
  }
  uint64_t Take() const { return read_.exchange(0); }

 private:
  mutable std::atomic<uint64_t> read_ = 0;
};

TEST(McapReader, ReadsOnlyTheSummaryAndTheChunksInRange) {
  std::vector<std::vector<uint64_t>> chunks;
  for (uint64_t i = 0; i < 2000; ++i) chunks.push_back({i, i, i});
  const Buffer bytes = ChunksOf(chunks);
  const auto source = std::make_shared<CountingSource>(bytes);
  const auto reader = std::move(*Reader::Open(source));
  const uint64_t summary = bytes.size() - reader->chunk_indexes().back().chunk_start;
  EXPECT_LT(source->Take(), summary + 200);
  EXPECT_EQ(Sequences(*reader, {.start_ns = 1500, .end_ns = 1500}).size(), 3U);
  EXPECT_LE(source->Take(), reader->chunk_indexes()[1500].chunk_length);
}

TEST(McapReader, ScansWhatHasNoSummary) {
  LogContent written;
  const Buffer bytes = RandomLogBytes({.seed = 9, .options = {.compression = Compression::kLz4}}, &written);
  const uint64_t end = Open(bytes)->chunk_indexes().back().chunk_start;
  const auto reader = Open(Bytes(bytes).first(end));
  ASSERT_TRUE(reader->scan());
  EXPECT_TRUE(reader->scan()->end_missing);
  EXPECT_THAT(reader->summary_problem(), HasSubstr("magic"));
  EXPECT_EQ(reader->statistics().message_count, Sequences(*reader, {}).size());
  EXPECT_LT(reader->statistics().message_count, written.messages.size());
  EXPECT_GT(reader->statistics().message_count, written.messages.size() / 4);
}

TEST(McapReader, ReadsMessagesOutsideOfChunks) {
  Buffer bytes(kMagic.begin(), kMagic.end());
  Append(Header{"", "x"}, bytes);
  Append(Schema{1, "s", "e", "d"}, bytes);
  Append(Channel{1, 1, "t", "m", {}}, bytes);
  for (uint32_t i = 0; i < 5; ++i) Append(Message{1, i, 10 - i, 0, AsBytes("abc")}, bytes);
  Append(Metadata{"m", {}}, bytes);
  Append(Message{1, 5, 7, 0, AsBytes("abc")}, bytes);
  Append(DataEnd{}, bytes);
  Append(Footer{}, bytes);
  AppendBytes(kMagic, bytes);
  const auto reader = Open(bytes);
  EXPECT_EQ(Sequences(*reader, {}), (Numbers{4, 3, 5, 2, 1, 0}));
  EXPECT_EQ(reader->metadata().size(), 1U);
  EXPECT_EQ(reader->schemas().at(1).data, "d");
  EXPECT_TRUE(Check(MemorySource(bytes))->ok());
  EXPECT_EQ(reader->summary_problem(), "");
}

TEST(McapReader, WhatCheckCallsGoodIsReadWholeWhateverItLacks) {
  LogContent written;
  const Buffer own = RandomLogBytes(
      {.seed = 11, .options = {.compression = Compression::kZstd, .chunk_bytes = 8000}}, &written);
  for (const ForeignForm form : kForeignForms) {
    const Buffer bytes = AsOthersWrite(own, form);
    const CheckReport check = *Check(MemorySource(bytes));
    EXPECT_TRUE(check.ok()) << FindingsOf(check);
    EXPECT_EQ(Open(bytes)->summary_problem(), "") << static_cast<int>(form);
    std::string error;
    EXPECT_EQ(ReadAll(bytes, &error), written) << static_cast<int>(form) << error;
  }
}

TEST(McapReader, WhatLacksIndexesAndIsDamagedSaysWhatIs) {
  const Buffer own = ChunksOf({{1, 2}, {3, 4}, {5, 6}});
  const ChunkIndex hit = Open(own)->chunk_indexes()[1];
  for (const ForeignForm form : {ForeignForm::kNoSummary, ForeignForm::kNoStatistics}) {
    Buffer bytes = AsOthersWrite(own, form);
    bytes[hit.chunk_start + hit.chunk_length - 1] ^= std::byte{1};
    const auto reader = Open(bytes);
    EXPECT_THAT(reader->summary_problem(),
                AllOf(HasSubstr("offset " + std::to_string(hit.chunk_start)), HasSubstr("CRC")));
    EXPECT_EQ(Sequences(*reader, {}), (Numbers{1, 2, 5, 6}));
  }
}

// Its sequence and size make its content that of a message index, as a wrong bit in such a record's type
// would.
TEST(McapReader, AMessageBesideChunksIsReadEvenIfItLooksLikeAnIndex) {
  BufferSink sink;
  const auto writer = std::move(*Writer::Create(sink));
  const uint16_t id = *writer->AddChannel({.topic = "a"});
  for (const uint32_t sequence : {31, 32}) {
    ASSERT_TRUE(writer
                    ->Write({.channel_id = id,
                             .sequence = sequence,
                             .log_time_ns = sequence,
                             .data = AsBytes("sixteen bytes is")})
                    .ok());
    ASSERT_TRUE(writer->Flush().ok());
  }
  ASSERT_TRUE(writer->Close().ok());
  const Buffer bytes = AsOthersWrite(sink.bytes(), ForeignForm::kLastChunkInPieces);
  const auto reader = Open(bytes);
  EXPECT_EQ(Sequences(*reader, {}), (Numbers{31, 32}));
  EXPECT_EQ(reader->summary_problem(), "");
}

TEST(McapReader, CountsTheMessagesOfChannelsThatTheStatisticsLeaveOut) {
  const Buffer own = ChunksOf({{1, 2}, {3}});
  const auto whole = Open(own);
  Statistics statistics = whole->statistics();
  statistics.channel_message_counts.clear();
  Buffer bytes = AsOthersWrite(own, ForeignForm::kNoSummary);
  bytes.resize(bytes.size() - kMagic.size() - kFooterBytes - kRecordHeaderBytes);
  SummaryWriter summary(0, true, bytes);
  summary.Add(Opcode::kChannel, whole->channels() | std::views::values);
  summary.Add(Opcode::kStatistics, std::span(&statistics, 1));
  summary.Add(Opcode::kChunkIndex, whole->chunk_indexes());
  summary.Finish();
  const auto reader = Open(bytes);
  EXPECT_EQ(reader->summary_problem(), "");
  EXPECT_EQ(reader->statistics().channel_message_counts, whole->statistics().channel_message_counts);
}

TEST(McapReader, RefusesWhatIsNoLog) {
  EXPECT_EQ(Reader::Open(std::make_shared<MemorySource>(Bytes())).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(Reader::Open(std::make_shared<MemorySource>(AsBytes("\x89MCAP1\r\n..."))).error().code,
            ErrorCode::kInvalidArgument);
}

TEST(McapReader, ADamagedAttachmentIsNamed) {
  Buffer bytes = testing::SmallLog();
  const AttachmentIndex index = Open(bytes)->attachments().at(0);
  bytes[index.offset + index.length - 5] ^= std::byte{1};
  Buffer buffer;
  const auto read = Open(bytes)->ReadAttachment(index, buffer);
  ASSERT_FALSE(read.ok());
  EXPECT_THAT(read.error().message, HasSubstr("offset " + std::to_string(index.offset)));
  EXPECT_FALSE(Open(bytes)->ReadMetadata({.offset = index.offset}).ok());
}

}  // namespace
}  // namespace taclink::mcap

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <random>
#include <set>

#include "mcap/recover.h"
#include "tests/mcap/log_content.h"

namespace taclink::mcap {
namespace {

using testing::CollectingVisitor;
using testing::FindingsOf;
using testing::LogContent;
using testing::RandomLogBytes;
using testing::ReadAll;
using testing::SmallLog;

constexpr std::array kCompressions = {Compression::kNone, Compression::kZstd, Compression::kLz4};

struct Scanned {
  LogContent content;
  ScanReport report;
};

Scanned ScanOf(Bytes bytes, const ScanOptions& options = {}) {
  CollectingVisitor visitor;
  auto report = Scan(MemorySource(bytes), visitor, options);
  EXPECT_TRUE(report.ok()) << report.error().message;
  return {.content = std::move(visitor.content), .report = std::move(*report)};
}

/// Recovers, checks the result, and returns what it holds.
LogContent Recovered(Bytes bytes) {
  BufferSink sink;
  const auto report = Recover(MemorySource(bytes), sink);
  EXPECT_TRUE(report.ok()) << report.error().message;
  const auto checked = Check(MemorySource(sink.bytes()));
  EXPECT_TRUE(checked->ok()) << FindingsOf(*checked);
  std::string error;
  LogContent content = ReadAll(sink.bytes(), &error);
  EXPECT_EQ(error, "");
  return content;
}

/// All of `part` are in `whole`, in the same order.
template <typename T>
bool IsPartOf(const std::vector<T>& part, const std::vector<T>& whole) {
  auto next = whole.begin();
  for (const T& item : part) {
    next = std::find(next, whole.end(), item);
    if (next == whole.end()) return false;
    ++next;
  }
  return true;
}

LogContent ContentOf(Bytes bytes) {
  std::string error;
  LogContent content = ReadAll(bytes, &error);
  EXPECT_EQ(error, "");
  return content;
}

TEST(McapScan, AnIntactLogIsClean) {
  LogContent written;
  const Buffer bytes =
      RandomLogBytes({.seed = 3, .options = {.profile = "p", .chunk_bytes = 3000}}, &written);
  const Scanned scanned = ScanOf(bytes);
  EXPECT_TRUE(scanned.report.clean()) << scanned.report.Text();
  EXPECT_EQ(scanned.content, written);
  EXPECT_EQ(scanned.report.recorded_messages, written.messages.size());
  EXPECT_EQ(Recovered(bytes), written);
}

TEST(McapDamage, TruncatedAnywhereALogKeepsWhatWasWhole) {
  for (const auto compression : kCompressions) {
    const Buffer bytes = SmallLog(compression);
    const LogContent whole = ContentOf(bytes);
    size_t messages = 0;
    for (size_t size = 0; size < bytes.size(); ++size) {
      const Bytes part = Bytes(bytes).first(size);
      EXPECT_FALSE(Check(MemorySource(part))->ok()) << size;
      std::string error;
      (void)ReadAll(part, &error);
      const Scanned scanned = ScanOf(part);
      EXPECT_TRUE(scanned.report.end_missing);
      EXPECT_TRUE(IsPartOf(scanned.content.messages, whole.messages)) << size;
      EXPECT_GE(scanned.content.messages.size(), messages) << "fewer than of a shorter part, at " << size;
      messages = scanned.content.messages.size();
      EXPECT_EQ(Recovered(part), scanned.content) << size;
    }
    EXPECT_EQ(messages, whole.messages.size());
  }
}

TEST(McapDamage, EveryFlippedBitIsFoundOrHarmless) {
  for (const auto compression : kCompressions) {
    Buffer bytes = SmallLog(compression);
    const LogContent whole = ContentOf(bytes);
    for (size_t bit = 0; bit < bytes.size() * 8; ++bit) {
      bytes[bit / 8] ^= std::byte{1} << (bit % 8);
      std::string error;
      const bool found = !Check(MemorySource(bytes))->ok();
      EXPECT_TRUE(found || ReadAll(bytes, &error) == whole) << "bit " << bit;
      const Scanned scanned = ScanOf(bytes);
      EXPECT_TRUE(IsPartOf(scanned.content.messages, whole.messages)) << "bit " << bit;
      EXPECT_GE(scanned.content.messages.size(), 1U) << "bit " << bit;
      EXPECT_EQ(Recovered(bytes).messages, scanned.content.messages) << "bit " << bit;
      bytes[bit / 8] ^= std::byte{1} << (bit % 8);
    }
  }
}

/// The chunks of a log whose messages are numbered by sequence.
struct Chunked {
  Buffer bytes;
  std::vector<ChunkIndex> chunks;
  LogContent content;
};

Chunked ManyChunks(Compression compression = Compression::kNone) {
  Chunked log;
  log.bytes =
      RandomLogBytes({.seed = 5, .options = {.compression = compression, .chunk_bytes = 2000}}, &log.content);
  log.chunks = (*Reader::Open(std::make_shared<MemorySource>(log.bytes)))->chunk_indexes();
  return log;
}

uint64_t MessagesIn(const Chunked& log, size_t chunk) {
  Buffer buffer;
  const MemorySource source(log.bytes);
  const auto record = ReadRecordAs<Chunk>(source, Opcode::kChunk, log.chunks[chunk].chunk_start, {}, buffer);
  Buffer records;
  Bytes rest = *LoadChunk(*record, {}, records);
  uint64_t messages = 0;
  while (!rest.empty()) messages += TakeRecord(rest)->opcode == Opcode::kMessage ? 1 : 0;
  return messages;
}

TEST(McapScan, LosesOnlyTheChunkThatIsDamaged) {
  for (const auto compression : kCompressions) {
    Chunked log = ManyChunks(compression);
    const ChunkIndex& chunk = log.chunks[3];
    const uint64_t lost = MessagesIn(log, 3);
    log.bytes[chunk.chunk_start + chunk.chunk_length / 2] ^= std::byte{0x10};
    const Scanned scanned = ScanOf(log.bytes);
    EXPECT_EQ(scanned.content.messages.size() + lost, log.content.messages.size());
    EXPECT_TRUE(IsPartOf(scanned.content.messages, log.content.messages));
    EXPECT_EQ(scanned.content.attachments, log.content.attachments);
    EXPECT_EQ(scanned.report.damaged_chunks, 1U);
    ASSERT_EQ(scanned.report.lost.size(), 1U);
    EXPECT_EQ(scanned.report.lost[0].offset, chunk.chunk_start);
    EXPECT_EQ(scanned.report.lost[0].length, chunk.chunk_length);
    EXPECT_FALSE(scanned.report.sequence_gaps.empty());
  }
}

TEST(McapScan, FindsTheNextChunkWhenALengthIsDamaged) {
  for (const auto compression : kCompressions) {
    for (const size_t byte : {0, 1, 3, 8}) {
      for (const bool with_summary : {true, false}) {
        Chunked log = ManyChunks(compression);
        const uint64_t lost = MessagesIn(log, 2);
        if (!with_summary) log.bytes.resize(log.chunks.back().chunk_start);
        const uint64_t after = with_summary ? 0 : MessagesIn(ManyChunks(compression), log.chunks.size() - 1);
        log.bytes[log.chunks[2].chunk_start + byte] ^= std::byte{0x21};
        const Scanned scanned = ScanOf(log.bytes);
        EXPECT_TRUE(IsPartOf(scanned.content.messages, log.content.messages));
        EXPECT_GE(scanned.content.messages.size() + lost + after, log.content.messages.size())
            << "byte " << byte << " " << scanned.report.Text();
      }
    }
  }
}

// One field of a chunk's head each, but for its CRC: the records are there, and the CRC says that they are
// right.
TEST(McapScan, SavesRecordsWhoseChunkHasADamagedHead) {
  constexpr uint64_t kContent = kRecordHeaderBytes;
  for (const auto compression : kCompressions) {
    const uint64_t name = NameOf(compression).size();
    const std::map<std::string, std::pair<uint64_t, size_t>> fields = {
        {"length", {1, 8}},
        {"times", {kContent, 16}},
        {"size", {kContent + 16, 8}},
        {"name's length", {kContent + 28, 4}},
        {"records' length", {kContent + 32 + name, 8}},
        {"type", {0, 1}},
    };
    for (const auto& [field, place] : fields) {
      // An uncompressed chunk is found by its name's length.
      if (compression == Compression::kNone && field == "name's length") continue;
      for (const uint64_t value : {uint64_t{0}, uint64_t{200}, uint64_t{1} << 31, ~uint64_t{0}}) {
        Chunked log = ManyChunks(compression);
        for (const size_t chunk : {2, 4}) {
          for (size_t i = 0; i < place.second; ++i)
            log.bytes[log.chunks[chunk].chunk_start + place.first + i] =
                static_cast<std::byte>(value >> (8 * (i % 8)));
        }
        const Scanned scanned = ScanOf(log.bytes);
        EXPECT_TRUE(scanned.content.messages == log.content.messages)
            << NameOf(compression) << " " << field << " " << value << ": " << scanned.report.Text();
        EXPECT_TRUE(Recovered(log.bytes).messages == log.content.messages);
      }
    }
  }
}

TEST(McapScan, ADamagedStartCostsNoMore) {
  for (const auto compression : {Compression::kZstd, Compression::kLz4}) {
    Chunked log = ManyChunks(compression);
    std::mt19937 random(3);
    const uint64_t lost = MessagesIn(log, 0);
    const auto& first = log.chunks[0];
    for (size_t i = 0; i < first.chunk_start + first.chunk_length / 2; ++i)
      log.bytes[i] = static_cast<std::byte>(random());
    const Scanned scanned = ScanOf(log.bytes);
    EXPECT_EQ(scanned.report.messages + lost, log.content.messages.size()) << scanned.report.Text();
    EXPECT_EQ(scanned.report.orphans, 0u) << "channels come from the summary";
    EXPECT_TRUE(IsPartOf(scanned.content.messages, log.content.messages));
  }
}

// But for an attachment, whose content may be a log itself.
TEST(McapScan, AChunkIsNoOtherRecord) {
  for (const auto compression : kCompressions) {
    for (const int type : {0, 1, 2, 3, 4, 5, 7, 8, 10, 11, 12, 13, 14, 15, 16, 0x80, 0xff}) {
      Chunked log = ManyChunks(compression);
      log.bytes[log.chunks[2].chunk_start] = static_cast<std::byte>(type);
      const Scanned scanned = ScanOf(log.bytes);
      EXPECT_TRUE(scanned.content.messages == log.content.messages)
          << NameOf(compression) << " " << type << " " << scanned.report.Text();
    }
  }
}

TEST(McapScan, ChannelsComeFromASummaryThatIsNotWhereItShouldBe) {
  for (const auto compression : kCompressions) {
    const Chunked log = ManyChunks(compression);
    const uint64_t end = log.chunks[0].chunk_start + log.chunks[0].chunk_length, lost = MessagesIn(log, 0);
    Buffer cut(log.bytes.begin() + static_cast<ptrdiff_t>(log.chunks[0].chunk_start + 700), log.bytes.end());
    Buffer without(log.bytes.begin(), log.bytes.begin() + static_cast<ptrdiff_t>(log.chunks[0].chunk_start));
    AppendBytes(Bytes(log.bytes).subspan(end), without);
    for (const Buffer& bytes : {cut, without}) {
      const Scanned scanned = ScanOf(bytes);
      EXPECT_EQ(scanned.report.messages + lost, log.content.messages.size()) << scanned.report.Text();
      EXPECT_TRUE(IsPartOf(scanned.content.messages, log.content.messages));
      EXPECT_EQ(scanned.report.orphans, 0u);
    }
  }
}

// Each beginning of a frame once cost a read of all that follows.
TEST(McapScan, DamageFullOfFramesBeginningsIsReadOnce) {
  Buffer bytes = SmallLog();
  const std::string magic = "zstd12345678\x28\xb5\x2f\xfd\xa0\xff\xff\xff\x03";
  for (int i = 0; i < 20'000; ++i) AppendBytes(AsBytes(magic), bytes);
  EXPECT_EQ(ScanOf(bytes).report.messages, ScanOf(SmallLog()).report.messages);
}

TEST(McapScan, SparedRecordsAreTakenOnce) {
  Chunked log = ManyChunks();
  log.bytes[log.chunks[3].chunk_start + kRecordHeaderBytes + 16] ^= std::byte{1};  // its size
  for (const bool keep_unverified : {false, true}) {
    const Scanned scanned = ScanOf(log.bytes, {.keep_unverified = keep_unverified});
    EXPECT_EQ(scanned.report.messages, log.content.messages.size());
    EXPECT_EQ(scanned.report.dropped, 0u);
  }
}

TEST(McapScan, KeepsWhatItCantVerifyOnlyWhenAsked) {
  Chunked log = ManyChunks();
  const ChunkIndex& chunk = log.chunks[3];
  log.bytes[chunk.chunk_start + chunk.chunk_length - 1] ^= std::byte{1};  // in the last message's data
  const Scanned strict = ScanOf(log.bytes);
  EXPECT_EQ(strict.report.dropped, MessagesIn(ManyChunks(), 3));
  const Scanned loose = ScanOf(log.bytes, {.keep_unverified = true});
  EXPECT_EQ(loose.report.messages, log.content.messages.size());
  EXPECT_EQ(loose.report.unverified, strict.report.dropped);
}

TEST(McapScan, TakesLostChannelsFromTheSummary) {
  Chunked log = ManyChunks();
  const uint64_t lost = MessagesIn(log, 0);
  log.bytes[log.chunks[0].chunk_start + log.chunks[0].chunk_length - 1] ^= std::byte{1};
  EXPECT_EQ(ScanOf(log.bytes).report.messages + lost, log.content.messages.size());
  log.bytes.resize(log.bytes.size() - 1);
  EXPECT_GT(ScanOf(log.bytes).report.orphans, 0U);
}

TEST(McapScan, GoesOnAfterForeignBytes) {
  const Chunked log = ManyChunks();
  std::mt19937 random(2);
  for (const size_t foreign : {1, 5000, 65535, 65536, 200'000}) {
    Buffer bytes(log.bytes.begin(), log.bytes.begin() + static_cast<ptrdiff_t>(log.chunks[2].chunk_start));
    for (size_t i = 0; i < foreign; ++i) bytes.push_back(static_cast<std::byte>(random()));
    AppendBytes(Bytes(log.bytes).subspan(log.chunks[2].chunk_start), bytes);
    const Scanned scanned = ScanOf(bytes);
    EXPECT_EQ(scanned.content, log.content) << foreign;
    EXPECT_EQ(scanned.report.lost_bytes, foreign);
    EXPECT_EQ(Recovered(bytes), log.content) << foreign;
  }
}

TEST(McapScan, OneLogAfterAnotherIsBoth) {
  LogContent first;
  LogContent second;
  Buffer bytes = RandomLogBytes({.seed = 1}, &first);
  AppendBytes(RandomLogBytes({.seed = 2}, &second), bytes);
  const LogContent both = Recovered(bytes);
  first.messages.insert(first.messages.end(), second.messages.begin(), second.messages.end());
  EXPECT_EQ(both.messages, first.messages);
  EXPECT_FALSE(Check(MemorySource(bytes))->ok());
}

TEST(McapScan, KeepsMessagesOfALogWithoutChunks) {
  Buffer bytes(kMagic.begin(), kMagic.end());
  Append(Header{"", "x"}, bytes);
  Append(Channel{1, 0, "t", "m", {}}, bytes);
  std::vector<size_t> places;
  for (uint32_t i = 1; i <= 20; ++i) {
    places.push_back(bytes.size());
    Append(Message{1, i, i, 0, AsBytes("abc")}, bytes);
  }
  bytes[places[9]] ^= std::byte{0x40};
  bytes[places[9] + 5] ^= std::byte{0x40};
  const Scanned scanned = ScanOf(bytes);
  EXPECT_EQ(scanned.report.messages, 19U) << scanned.report.Text();
  EXPECT_EQ(scanned.report.sequence_gaps.at(1).missing, 1U);
  EXPECT_TRUE(scanned.report.end_missing);
}

TEST(McapDamage, RandomDamageNeverGivesWrongMessages) {
  const Chunked log = ManyChunks(Compression::kLz4);
  std::mt19937 random(11);
  for (int round = 0; round < 300; ++round) {
    Buffer bytes = log.bytes;
    const size_t start = random() % bytes.size();
    const size_t size = std::min<size_t>(random() % 3000, bytes.size() - start);
    for (size_t i = 0; i < size; ++i)
      bytes[start + i] = static_cast<std::byte>(round % 3 == 0 ? 0 : random());
    const LogContent content = Recovered(bytes);
    EXPECT_TRUE(IsPartOf(content.messages, log.content.messages)) << round;
    EXPECT_GT(content.messages.size() * 2, log.content.messages.size()) << round;
  }
}

// Lengths, types and CRCs are what leads through a log. TACLINK_MUTATIONS: how many logs.
TEST(McapDamage, AtBoundariesOfRecordsNeverGivesWrongMessages) {
  const char* const wanted = std::getenv("TACLINK_MUTATIONS");
  const int rounds = wanted != nullptr ? std::atoi(wanted) : 600;
  std::mt19937_64 random(17);
  for (const auto compression : kCompressions) {
    LogContent whole;
    const Buffer bytes = RandomLogBytes(
        {.seed = 6, .messages = 40, .options = {.compression = compression, .chunk_bytes = 2000}}, &whole);
    std::vector<uint64_t> starts;
    for (uint64_t at = kMagic.size(); at + kMagic.size() < bytes.size();) {
      starts.push_back(at);
      at += kRecordHeaderBytes + DecodeRecordHeader(Bytes(bytes).subspan(at)).length;
    }
    for (int round = 0; round < rounds / 3; ++round) {
      Buffer damaged = bytes;
      for (uint64_t mutations = 1 + random() % 3; mutations > 0; --mutations) {
        const uint64_t at = starts[random() % starts.size()];
        // The type; the length; the first fields, of a chunk up to its CRC and compression; the end.
        constexpr std::array<uint64_t, 5> kPlaces = {0, 1, 9, 9 + 24, 9 + 28};
        const uint64_t place = at + kPlaces[random() % kPlaces.size()];
        const uint64_t value = random() % 4 == 0 ? random() % 300 : random() >> (random() % 64);
        for (uint64_t i = 0; i < 8 && place + i < damaged.size(); ++i) {
          if (i > 0 && place == at) break;
          damaged[place + i] = static_cast<std::byte>(value >> (8 * i));
        }
      }
      const Scanned scanned = ScanOf(damaged);
      ASSERT_TRUE(IsPartOf(scanned.content.messages, whole.messages)) << NameOf(compression) << " " << round;
      ASSERT_TRUE(Recovered(damaged).messages == scanned.content.messages)
          << NameOf(compression) << " " << round;
    }
  }
}

/// The findings of a log with one record changed.
template <typename Change>
std::string FindingsAfter(Change change) {
  Buffer bytes = SmallLog();
  change(bytes);
  return FindingsOf(*Check(MemorySource(bytes)));
}

TEST(McapCheck, NamesWhatDisagrees) {
  Buffer bytes(kMagic.begin(), kMagic.end());
  Append(Header{"", "x"}, bytes);
  Append(Channel{1, 7, "t", "m", {}}, bytes);
  Append(Message{2, 0, 9, 0, {}}, bytes);
  Append(MessageIndex{2, {}}, bytes);
  Append(DataEnd{5}, bytes);
  const uint64_t summary = bytes.size();
  Append(Channel{1, 7, "other", "m", {}}, bytes);
  Append(Statistics{.message_count = 3}, bytes);
  Append(Channel{2, 0, "u", "m", {}}, bytes);
  Append(MetadataIndex{77, 1, "n"}, bytes);
  const uint64_t offsets = bytes.size();
  Append(SummaryOffset{Opcode::kStatistics, 1, 1}, bytes);
  Append(Footer{summary, offsets, 1}, bytes);
  AppendBytes(kMagic, bytes);
  const std::string findings = FindingsOf(*Check(MemorySource(bytes)));
  for (const char* part :
       {"before its schema 7", "before its channel 2", "does not follow a chunk", "data section is wrong",
        "differs from that in the data", "messages: the statistics say 3, there are 1",
        "apart from the others", "first log time", "index of a metadata record at 77",
        "summary offset of Statistics", "CRC of the summary"}) {
    EXPECT_NE(findings.find(part), std::string::npos) << part << "\nin:\n" << findings;
  }
}

TEST(McapCheck, SeesWhatIsBehindTheEnd) {
  EXPECT_NE(FindingsAfter([](Buffer& bytes) { bytes.push_back(std::byte{}); }), "");
  EXPECT_EQ(FindingsAfter([](Buffer&) {}), "");
}

}  // namespace
}  // namespace taclink::mcap

#include "mcap/writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>

#include "mcap/file_sink.h"
#include "mcap/recover.h"
#include "tests/mcap/log_content.h"

namespace taclink::mcap {
namespace {

using testing::FindingsOf;
using testing::LogContent;
using testing::RandomLog;
using testing::RandomLogBytes;
using testing::ReadAll;

CheckReport Checked(Bytes bytes) {
  return *Check(MemorySource(bytes));
}

class McapRoundTrip : public ::testing::TestWithParam<Compression> {};
INSTANTIATE_TEST_SUITE_P(All, McapRoundTrip,
                         ::testing::Values(Compression::kNone, Compression::kZstd, Compression::kLz4),
                         [](const auto& of) {
                           return of.param == Compression::kNone ? "none" : std::string(NameOf(of.param));
                         });

TEST_P(McapRoundTrip, RandomLogsComeBackAndPassTheCheck) {
  for (uint32_t seed = 1; seed <= 30; ++seed) {
    LogContent written;
    const Buffer bytes = RandomLogBytes({.seed = seed,
                                         .messages = seed * 7 % 300,
                                         .options = {.profile = "p",
                                                     .compression = GetParam(),
                                                     .chunk_bytes = 500 * seed,
                                                     .crcs = seed % 5 != 0}},
                                        &written);
    std::string error;
    EXPECT_EQ(ReadAll(bytes, &error), written) << "seed " << seed << ": " << error;
    const CheckReport report = Checked(bytes);
    EXPECT_EQ(FindingsOf(report), "") << "seed " << seed;
  }
}

TEST(McapWriter, EmptyLogIsWhole) {
  BufferSink sink;
  ASSERT_TRUE((*Writer::Create(sink))->Close().ok());
  EXPECT_EQ(FindingsOf(Checked(sink.bytes())), "");
  std::string error;
  EXPECT_TRUE(ReadAll(sink.bytes(), &error).messages.empty());
  EXPECT_EQ(error, "");
}

TEST(McapWriter, OnlyAttachments) {
  BufferSink sink;
  const auto writer = std::move(*Writer::Create(sink));
  ASSERT_TRUE(
      writer->AddAttachment({.log_time_ns = 7, .name = "a", .media_type = "b", .data = AsBytes("c")}).ok());
  ASSERT_TRUE(writer->AddAttachment({.name = "empty"}).ok());
  ASSERT_TRUE(writer->Close().ok());
  EXPECT_EQ(FindingsOf(Checked(sink.bytes())), "");
  std::string error;
  const LogContent content = ReadAll(sink.bytes(), &error);
  ASSERT_EQ(content.attachments.size(), 2U);
  EXPECT_EQ(content.attachments[0].data, "c");
  EXPECT_EQ(content.attachments[1].name, "empty");
}

TEST(McapWriter, ChannelWithoutMessagesIsKept) {
  BufferSink sink;
  const auto writer = std::move(*Writer::Create(sink));
  ASSERT_TRUE(writer->AddChannel({.topic = "silent"}).ok());
  ASSERT_TRUE(writer->Close().ok());
  EXPECT_EQ(FindingsOf(Checked(sink.bytes())), "");
  const auto reader = Reader::Open(std::make_shared<MemorySource>(sink.bytes()));
  EXPECT_EQ((*reader)->channels().at(1).topic, "silent");
}

TEST(McapWriter, RefusesWhatCantBeWritten) {
  BufferSink sink;
  const auto writer = std::move(*Writer::Create(sink));
  EXPECT_EQ(writer->Write({.channel_id = 9}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(writer->AddChannel({.schema_id = 4}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(writer->KeepChannel({.schema_id = 4}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(writer->KeepSchema({.id = 0, .name = "s"}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(writer->KeepChannel({.id = 65535, .topic = "a"}).ok());
  EXPECT_TRUE(writer->KeepChannel({.id = 65535, .topic = "a"}).ok());
  EXPECT_EQ(writer->KeepChannel({.id = 65535, .topic = "b"}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(*writer->AddChannel({.topic = "b"}), 1);
  ASSERT_TRUE(writer->Close().ok());
  EXPECT_EQ(writer->Write({.channel_id = 1}).error().code, ErrorCode::kFailedPrecondition);
  EXPECT_FALSE(Writer::Create(sink).ok()) << "the sink is not empty";
}

// Only schemas reserve the id 0.
TEST(McapWriter, AChannelMayHaveTheId0) {
  BufferSink sink;
  const auto writer = std::move(*Writer::Create(sink));
  ASSERT_TRUE(writer->KeepSchema({.id = 1, .name = "s"}).ok());
  ASSERT_TRUE(writer->KeepChannel({.id = 0, .schema_id = 1, .topic = "zero"}).ok());
  ASSERT_TRUE(writer->KeepChannel({.id = 1, .schema_id = 1, .topic = "one"}).ok());
  EXPECT_EQ(*writer->AddChannel({.id = 1, .topic = "new"}), 2) << "its own id is ignored";
  EXPECT_EQ(*writer->AddSchema({.id = 1, .name = "new"}), 2);
  for (uint16_t id = 0; id < 2; ++id) {
    ASSERT_TRUE(writer->Write({.channel_id = id, .log_time_ns = id, .data = AsBytes("data")}).ok());
  }
  ASSERT_TRUE(writer->Close().ok());
  EXPECT_EQ(FindingsOf(Checked(sink.bytes())), "");
  std::string error;
  const LogContent content = ReadAll(sink.bytes(), &error);
  ASSERT_EQ(content.messages.size(), 2U) << error;
  EXPECT_EQ(content.messages[0].topic, "zero");
  EXPECT_EQ(content.messages[1].topic, "one");
}

TEST(McapRecover, KeepsChannel0AndItsNeighbor) {
  BufferSink sink, recovered;
  const auto writer = std::move(*Writer::Create(sink));
  for (uint16_t id = 0; id < 2; ++id) {
    ASSERT_TRUE(writer->KeepChannel({.id = id, .topic = std::to_string(id)}).ok());
    ASSERT_TRUE(writer->Write({.channel_id = id, .log_time_ns = id, .data = AsBytes("data")}).ok());
  }
  ASSERT_TRUE(writer->Flush().ok());
  ASSERT_TRUE(Recover(MemorySource(sink.bytes()), recovered).ok());
  const auto reader = std::move(*Reader::Open(std::make_shared<MemorySource>(recovered.bytes())));
  ASSERT_EQ(reader->channels().size(), 2U);
  EXPECT_EQ(reader->channels().at(0).topic, "0");
  EXPECT_EQ(reader->channels().at(1).topic, "1");
}

TEST(McapWriter, LargeDataAreNotCopiedAndLetGoWhenWritten) {
  BufferSink sink;
  const auto writer = std::move(*Writer::Create(sink, {.chunk_bytes = 100'000}));
  const uint16_t id = *writer->AddChannel({.topic = "a"});
  const auto data = std::make_shared<const std::string>(50'000, 'x');
  ASSERT_TRUE(writer->Write({.channel_id = id, .data = AsBytes(*data)}, data).ok());
  EXPECT_EQ(data.use_count(), 2);
  ASSERT_TRUE(writer->Write({.channel_id = id, .data = AsBytes(*data)}, data).ok());
  EXPECT_EQ(data.use_count(), 1) << "the chunk was full";
  EXPECT_GT(sink.position(), 100'000U);
  EXPECT_EQ(writer->open_bytes(), 0U);
}

TEST(McapWriter, FlushHandsAllToTheSink) {
  BufferSink sink;
  const auto writer = std::move(*Writer::Create(sink));
  const uint16_t id = *writer->AddChannel({.topic = "a"});
  ASSERT_TRUE(writer->Write({.channel_id = id, .data = AsBytes("only one")}).ok());
  const uint64_t before = sink.position();
  ASSERT_TRUE(writer->Sync().ok());
  EXPECT_GT(sink.position(), before);
  EXPECT_EQ(writer->statistics().message_count, 1U);
  std::string error;
  EXPECT_EQ(ReadAll(sink.bytes(), &error).messages.size(), 1U) << "not closed, but readable: " << error;
}

/// Fails from call `fail_from` of Append on, `failures` times, and leaves a part of the bytes.
class FailingSink : public BufferSink {
 public:
  FailingSink(int fail_from, int failures, bool can_cut)
      : fail_from_(fail_from), failures_(failures), can_cut_(can_cut) {}

  Result<void> Append(std::span<const Bytes> pieces) override {
    if (++calls_ < fail_from_ || failures_ == 0) {
      const auto appended = BufferSink::Append(pieces);
      good_ = BufferSink::position();
      return appended;
    }
    --failures_;
    const Bytes piece = pieces.front();
    (void)BufferSink::Append(std::array<Bytes, 1>{piece.first(piece.size() / 2)});
    return Error{ErrorCode::kResourceExhausted, "disk full"};
  }
  Result<void> Truncate(uint64_t position) override {
    if (!can_cut_ && failures_ > 0) {
      --failures_;
      return Error{ErrorCode::kUnavailable, "can't"};
    }
    return BufferSink::Truncate(position);
  }
  uint64_t position() const override { return good_; }
  int calls() const { return calls_; }
  bool failed() const { return calls_ >= fail_from_; }

 private:
  int calls_ = 0;
  const int fail_from_;
  int failures_;
  const bool can_cut_;
  uint64_t good_ = 0;
};

/// Writes `messages` and ends the log, trying Close twice. Returns how many messages the writer says are
/// lost.
uint64_t WriteThrough(FailingSink& sink, uint32_t messages) {
  auto created = Writer::Create(sink, {.chunk_bytes = 300});
  if (!created) created = Writer::Create(sink, {.chunk_bytes = 300});
  const auto writer = std::move(*created);
  const uint16_t schema = *writer->AddSchema({.name = "s"});
  const std::array ids = {*writer->AddChannel({.schema_id = schema, .topic = "a"}),
                          *writer->AddChannel({.topic = "b"})};
  const std::string data(40, 'd');
  for (uint32_t i = 0; i < messages; ++i) {
    (void)writer->Write(
        {.channel_id = ids[i % 2], .sequence = i + 1, .log_time_ns = i, .data = AsBytes(data)});
    if (i % 9 == 3) (void)writer->AddMetadata({.name = "m"});
    if (i % 9 == 5) (void)writer->AddAttachment({.name = "a", .data = AsBytes(data)});
  }
  const bool closed = writer->Close().ok() || writer->Close().ok();
  EXPECT_TRUE(closed);
  uint64_t lost = 0;
  for (const auto& [id, count] : writer->lost()) lost += count;
  return lost;
}

TEST(McapWriter, AFailureAtAnyWriteLosesOnlyItsChunk) {
  constexpr uint32_t kMessages = 40;
  for (const bool can_cut : {true, false}) {
    for (int fail = 2;; ++fail) {
      FailingSink sink(fail, can_cut ? 1 : 2, can_cut);
      const uint64_t lost = WriteThrough(sink, kMessages);
      if (!sink.failed()) break;
      const CheckReport report = Checked(sink.bytes());
      EXPECT_EQ(FindingsOf(report), "") << "failure at write " << fail;
      std::string error;
      EXPECT_EQ(ReadAll(sink.bytes(), &error).messages.size() + lost, kMessages)
          << "failure at write " << fail;
      EXPECT_LE(lost, 20U);
    }
  }
}

TEST(McapWriter, AfterAFailureTheLogIsReadableWithoutClose) {
  for (int fail = 2; fail < 12; ++fail) {
    FailingSink sink(fail, 1'000'000, true);
    const auto writer = std::move(*Writer::Create(sink, {.chunk_bytes = 300}));
    const uint16_t id = *writer->AddChannel({.topic = "a"});
    for (uint32_t i = 0; i < 100; ++i) {
      (void)writer->Write({.channel_id = id, .sequence = i, .log_time_ns = i, .data = AsBytes("0123456789")});
    }
    EXPECT_FALSE(writer->Close().ok());
    std::string error;
    const LogContent content = ReadAll(sink.bytes(), &error);
    EXPECT_EQ(error, "");
    EXPECT_EQ(content.messages.size(), writer->statistics().message_count);
    EXPECT_EQ(content.messages.size() + writer->lost().at(id), 100U);
  }
}

class McapFile : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("mcap_file_" + std::to_string(getpid()));
};

TEST_F(McapFile, HoldsWhatMemoryHolds) {
  const std::string path = folder_ / "log.mcap";
  const RandomLog log{.seed = 4};
  const auto sink = std::move(*FileSink::Create(path));
  (void)log.WriteTo(*sink);
  ASSERT_TRUE(sink->Sync().ok());
  const Buffer expected = RandomLogBytes(log);
  const auto source = std::move(*FileSource::Open(path));
  Buffer bytes(source->size());
  ASSERT_TRUE(source->Read(0, bytes).ok());
  EXPECT_EQ(bytes, expected);
  EXPECT_FALSE(source->Read(1, bytes).ok());
}

TEST_F(McapFile, ErrorsNameThePathAndWhatToDo) {
  const std::string path = folder_ / "log.mcap";
  ASSERT_TRUE(FileSink::Create(path).ok());
  const auto again = FileSink::Create(path);
  EXPECT_EQ(again.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(again.error().message, ::testing::HasSubstr(path));
  EXPECT_EQ(FileSink::Create(folder_ / "none" / "log").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(FileSource::Open(folder_ / "none").error().code, ErrorCode::kNotFound);
}

// Each but the first would keep the reader waiting, or can't be read at a place.
TEST_F(McapFile, WhatIsNoRegularFileIsSaidToBe) {
  const std::string pipe = folder_ / "pipe", socket = folder_ / "socket";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  ASSERT_EQ(mknod(socket.c_str(), S_IFSOCK | 0600, 0), 0);
  const std::pair<std::string, const char*> cases[] = {
      {folder_, "a folder; name a log in it"},
      {pipe, "a pipe (FIFO); logs are read at random places"},
      {socket, "a socket"},
      {"/dev/zero", "a device"}};
  for (const auto& [path, what] : cases) {
    const auto source = FileSource::Open(path);
    ASSERT_FALSE(source.ok()) << path;
    EXPECT_EQ(source.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(source.error().message,
                ::testing::AllOf(::testing::HasSubstr(path), ::testing::HasSubstr(what)));
  }
}

TEST_F(McapFile, AFullDiskLeavesAReadableFileThatCanGoOn) {
  const std::string path = folder_ / "log.mcap";
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  getrlimit(RLIMIT_FSIZE, &old);
  const auto sink = std::move(*FileSink::Create(path));
  const auto writer = std::move(*Writer::Create(*sink, {.chunk_bytes = 10'000}));
  const uint16_t id = *writer->AddChannel({.topic = "a"});
  const std::string data(1000, 'x');
  const auto write = [&](uint32_t i) {
    return writer->Write({.channel_id = id, .sequence = i, .log_time_ns = i, .data = AsBytes(data)});
  };
  const rlimit small{.rlim_cur = 50'000, .rlim_max = old.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  std::string trouble;
  for (uint32_t i = 0; i < 100; ++i) {
    if (const auto written = write(i); !written) trouble = written.error().message;
  }
  setrlimit(RLIMIT_FSIZE, &old);
  EXPECT_THAT(trouble, ::testing::AllOf(::testing::HasSubstr(path), ::testing::HasSubstr("free space")));
  EXPECT_LE(std::filesystem::file_size(path), 50'000U);
  for (uint32_t i = 100; i < 200; ++i) EXPECT_TRUE(write(i).ok());
  ASSERT_TRUE(writer->Close().ok());
  const auto source = std::move(*FileSource::Open(path));
  EXPECT_EQ(FindingsOf(*Check(*source)), "");
  EXPECT_EQ(writer->statistics().message_count + writer->lost().at(id), 200U);
  EXPECT_GT(writer->statistics().message_count, 130U);
}

}  // namespace
}  // namespace taclink::mcap

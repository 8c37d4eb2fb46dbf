// taclink log cut, on logs of known content.
#include <gmock/gmock.h>

#include <fstream>

#include "mcap/file_sink.h"
#include "mcap/writer.h"
#include "tests/client/command/log_content.h"

namespace taclink::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr uint64_t kLogStartNs = kStartUtcNs + 1;  // of the first joint sample

template <typename Keep>
std::vector<LoggedMessage> Filtered(std::vector<LoggedMessage> messages, Keep keep) {
  std::erase_if(messages, [&](const LoggedMessage& message) { return !keep(message); });
  return messages;
}

class LogCutTest : public LogToolTest {
 protected:
  LogCutTest() { WriteLog(log_); }
  const std::string log_ = Path("log.mcap"), out_ = Path("out.mcap");
};

TEST_F(LogCutTest, WithoutARangeEverythingIsCopied) {
  LogDoes({"cut", log_, "-o", out_});
  EXPECT_EQ(MessagesIn(out_), MessagesIn(log_));
  const auto from = OpenLog(log_), to = OpenLog(out_);
  EXPECT_EQ(to->schemas(), from->schemas());
  EXPECT_EQ(to->channels(), from->channels());
  EXPECT_EQ(to->header(), from->header());
  EXPECT_EQ(AttachmentsIn(out_), AttachmentsIn(log_));
  EXPECT_EQ(AttachmentsIn(out_).size(), 2u);
  EXPECT_EQ(MetadataIn(out_), MetadataIn(log_));
  EXPECT_EQ(to->chunk_indexes().front().compression, "zstd");
  EXPECT_TRUE(IsWhole(out_));
}

TEST_F(LogCutTest, ARangeBeginsAtFromAndEndsBeforeTo) {
  const uint64_t from = kLogStartNs + 2'000'000'000, to = kLogStartNs + 5'000'000'000;
  LogDoes({"cut", log_, "-o", out_, "--from", "2", "--to", "5"});
  const auto expected = Filtered(MessagesIn(log_), [&](const LoggedMessage& message) {
    return message.log_time_ns >= from && message.log_time_ns < to;
  });
  EXPECT_EQ(expected.size(), 30u * 4 + 6 + 3) << "frames and pictures, joints, events";
  EXPECT_EQ(MessagesIn(out_), expected);
  EXPECT_EQ(AttachmentsIn(out_), AttachmentsIn(log_));
  EXPECT_TRUE(IsWhole(out_));
}

TEST_F(LogCutTest, TimesMayBeUtc) {
  LogDoes({"cut", log_, "-o", out_, "--from", "2026-01-02T03:04:06.020Z", "--to", "2026-01-02T03:04:06.12Z"});
  std::vector<uint64_t> frames;
  for (const LoggedMessage& message : MessagesIn(out_)) {
    if (message.schema == "taclink.v1.LinkFrame") frames.push_back(message.sequence);
  }
  EXPECT_EQ(frames, (std::vector<uint64_t>{10, 10})) << "of both links, 1 s after 03:04:05";
}

TEST_F(LogCutTest, OneLinkKeepsTheTopicsOfTheArm) {
  LogDoes({"cut", log_, "-o", out_, "--link", "upper"});
  EXPECT_EQ(MessagesIn(out_), Filtered(MessagesIn(log_), [](const LoggedMessage& message) {
              return !message.topic.starts_with("/links/lower/");
            }));
  const auto cut = OpenLog(out_);
  for (const auto& [id, channel] : cut->channels()) EXPECT_FALSE(channel.topic.starts_with("/links/lower/"));
  EXPECT_TRUE(IsWhole(out_));
}

TEST_F(LogCutTest, PicturesCanBeLeftOut) {
  LogDoes({"cut", log_, "-o", out_, "--without-pictures"});
  EXPECT_EQ(MessagesIn(out_), Filtered(MessagesIn(log_), [](const LoggedMessage& message) {
              return message.schema != "foxglove.CompressedImage";
            }));
  EXPECT_LT(MessagesIn(out_).size(), MessagesIn(log_).size());
}

TEST_F(LogCutTest, OnlySomeTopicsCanBeKept) {
  LogDoes({"cut", log_, "-o", out_, "--only-topics", "/events", "/joint_states"});
  EXPECT_EQ(MessagesIn(out_).size(), Events().size() + kJointSamples);
  const Finished wrong = Log({"cut", log_, "-o", Path("none.mcap"), "--only-topics", "/evnts"});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.err, AllOf(HasSubstr("/evnts"), HasSubstr("/events"), HasSubstr("/links/upper/frame")));
  EXPECT_FALSE(Exists("none.mcap"));
}

TEST_F(LogCutTest, TheCompressionCanBeChanged) {
  for (const std::string name : {"none", "lz4", "zstd"}) {
    const std::string out = Path(name + ".mcap");
    LogDoes({"cut", log_, "-o", out, "--compression", name});
    EXPECT_EQ(OpenLog(out)->chunk_indexes().front().compression, name == "none" ? "" : name);
    EXPECT_EQ(MessagesIn(out), MessagesIn(log_));
  }
  LogDoes({"cut", Path("lz4.mcap"), "-o", out_});
  EXPECT_EQ(OpenLog(out_)->chunk_indexes().front().compression, "lz4") << "as the source's";
}

TEST_F(LogCutTest, TheHalvesMergeToTheWhole) {
  const std::string first = Path("first.mcap"), second = Path("second.mcap");
  LogDoes({"cut", log_, "-o", first, "--to", "4.7"});
  LogDoes({"cut", log_, "-o", second, "--from", "4.7"});
  LogDoes({"merge", second, first, "-o", out_});
  EXPECT_EQ(MessagesIn(out_), MessagesIn(log_));
  EXPECT_EQ(OpenLog(out_)->channels().size(), OpenLog(log_)->channels().size());
  EXPECT_EQ(AttachmentsIn(out_), AttachmentsIn(log_));
  EXPECT_EQ(MetadataIn(out_), MetadataIn(log_));
}

// Of the ids that a log may use, 0 is reserved among schemas only.
TEST_F(LogCutTest, AChannelOfTheId0KeepsIt) {
  const std::string zero = Path("zero.mcap");
  {
    const auto sink = std::move(*mcap::FileSink::Create(zero));
    const auto writer = std::move(*mcap::Writer::Create(*sink));
    ASSERT_TRUE(writer->KeepSchema({.id = 7, .name = "Thing", .encoding = "jsonschema", .data = "{}"}).ok());
    for (uint16_t id = 0; id < 2; ++id) {
      const std::string topic = "/thing" + std::to_string(id);
      ASSERT_TRUE(
          writer->KeepChannel({.id = id, .schema_id = 7, .topic = topic, .message_encoding = "json"}).ok());
      ASSERT_TRUE(writer->Write({.channel_id = id, .log_time_ns = id, .data = mcap::AsBytes("{}")}).ok());
    }
    ASSERT_TRUE(writer->Close().ok());
  }
  LogDoes({"cut", zero, "-o", out_});
  EXPECT_EQ(MessagesIn(out_), MessagesIn(zero));
  EXPECT_EQ(OpenLog(out_)->channels(), OpenLog(zero)->channels());
  EXPECT_EQ(OpenLog(out_)->schemas(), OpenLog(zero)->schemas());
  EXPECT_TRUE(IsWhole(out_));
  LogDoes({"merge", zero, zero, "-o", Path("merged.mcap")});
  EXPECT_EQ(MessagesIn(Path("merged.mcap")).size(), 4u);
  EXPECT_EQ(OpenLog(Path("merged.mcap"))->channels().size(), 2u);
}

TEST_F(LogCutTest, WhatCannotBeIsRefusedAndNothingIsLeftBehind) {
  const auto refused = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"cut", log_, "-o", out_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Finished run = Log(arguments);
    EXPECT_EQ(run.exit_code, 1) << run.out;
    EXPECT_FALSE(Exists("out.mcap"));
    return run.err;
  };
  EXPECT_THAT(refused({"--from", "5", "--to", "3"}), HasSubstr("--from 5 is not before --to 3"));
  EXPECT_THAT(refused({"--from", "5", "--to", "5"}), HasSubstr("not before"));
  EXPECT_THAT(refused({"--from", "3600"}),
              AllOf(HasSubstr("2026-01-02 03:04:05.000 UTC"), HasSubstr("log.mcap")));
  EXPECT_THAT(refused({"--to", "2026-01-01T00:00:00Z"}), HasSubstr("log.mcap"));
  for (const char* time : {"soon", "nan", "1e400", "2026-02-30T00:00:00Z", "2026-01-02T24:00:00Z", "-1s"})
    EXPECT_THAT(refused({"--from", time}), AllOf(HasSubstr("--from"), HasSubstr(time))) << time;
  EXPECT_THAT(refused({"--link", "middle"}), AllOf(HasSubstr("'middle'"), HasSubstr("lower, upper")));
}

TEST_F(LogCutTest, WhatIsThereIsNotOverwritten) {
  std::ofstream(out_) << "precious";
  const Finished run = Log({"cut", log_, "-o", out_});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("out.mcap"));
  EXPECT_EQ(FileText(out_), "precious");
  const uintmax_t size = std::filesystem::file_size(log_);
  EXPECT_EQ(Log({"cut", log_, "-o", log_}).exit_code, 1);
  EXPECT_EQ(std::filesystem::file_size(log_), size);
}

TEST_F(LogCutTest, ATruncatedLogGivesWhatIsIntactAndSaysSo) {
  const std::string torn = Truncated(log_, 0.6);
  const Finished run = Log({"cut", torn, "-o", out_});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err,
              AllOf(HasSubstr(torn), HasSubstr("taclink log recover"), HasSubstr("the end is missing")));
  const auto all = MessagesIn(log_), kept = MessagesIn(out_);
  ASSERT_GT(kept.size(), all.size() / 4);
  EXPECT_TRUE(std::equal(kept.begin(), kept.end(), all.begin()));
  EXPECT_TRUE(IsWhole(out_));
}

TEST_F(LogCutTest, ADamagedChunkIsLeftOutAndSaidSo) {
  const auto chunks = OpenLog(log_)->chunk_indexes();
  const mcap::ChunkIndex& hit = chunks.at(chunks.size() / 2);
  {
    std::fstream file(log_, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(hit.chunk_start + hit.chunk_length / 2));
    file << "damage";
  }
  const Finished run = Log({"cut", log_, "-o", out_});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, AllOf(HasSubstr("taclink log recover"), HasSubstr(std::to_string(hit.chunk_start))));
  WriteLog(Path("intact.mcap"));
  const size_t all = MessagesIn(Path("intact.mcap")).size(), kept = MessagesIn(out_).size();
  EXPECT_LT(kept, all);
  EXPECT_GT(kept, all * 8 / 10);
}

TEST_F(LogCutTest, WhatIsNoLogIsRefused) {
  std::ofstream(Path("text.mcap")) << "this is no log";
  const Finished run = Log({"cut", Path("text.mcap"), "-o", out_});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("text.mcap"));
  const Finished nothing_left = Log({"cut", Truncated(log_, 0.002), "-o", out_});
  EXPECT_EQ(nothing_left.exit_code, 1);
  EXPECT_THAT(nothing_left.err, HasSubstr("not one of the messages"));
  EXPECT_FALSE(Exists("out.mcap"));
}

}  // namespace
}  // namespace taclink::testing

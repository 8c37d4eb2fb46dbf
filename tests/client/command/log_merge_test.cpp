// taclink log merge, on logs of known content.
#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>

#include "mcap/file_sink.h"
#include "mcap/writer.h"
#include "tests/client/command/log_content.h"

namespace taclink::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

class LogMergeTest : public LogToolTest {
 protected:
  const std::string a_ = Path("a.mcap"), b_ = Path("b.mcap"), out_ = Path("out.mcap");
};

// One channel with one message.
void WriteOne(const std::string& path, const mcap::Schema& schema, const mcap::Channel& channel,
              uint64_t time_ns) {
  auto sink = mcap::FileSink::Create(path);
  ASSERT_TRUE(sink.ok());
  auto writer = mcap::Writer::Create(**sink);
  ASSERT_TRUE(writer.ok());
  mcap::Channel copy = channel;
  copy.schema_id = *(*writer)->AddSchema(schema);
  const auto id = (*writer)->AddChannel(copy);
  ASSERT_TRUE(id.ok());
  ASSERT_TRUE((*writer)
                  ->Write({.channel_id = *id,
                           .sequence = 5,
                           .log_time_ns = time_ns,
                           .publish_time_ns = time_ns,
                           .data = mcap::AsBytes(path)})
                  .ok());
  ASSERT_TRUE((*writer)->Close().ok());
}

TEST_F(LogMergeTest, ALogWithItselfHasEachMessageTwiceAndAllElseOnce) {
  WriteLog(a_);
  LogDoes({"merge", a_, a_, "-o", out_});
  const auto once = MessagesIn(a_), twice = MessagesIn(out_);
  ASSERT_EQ(twice.size(), 2 * once.size());
  for (const LoggedMessage& message : once) EXPECT_EQ(std::ranges::count(twice, message), 2) << message.topic;
  EXPECT_TRUE(std::ranges::is_sorted(twice, {}, &LoggedMessage::log_time_ns));
  EXPECT_EQ(OpenLog(out_)->channels().size(), OpenLog(a_)->channels().size());
  EXPECT_EQ(OpenLog(out_)->schemas().size(), OpenLog(a_)->schemas().size());
  EXPECT_EQ(AttachmentsIn(out_), AttachmentsIn(a_));
  EXPECT_EQ(MetadataIn(out_), MetadataIn(a_));
  EXPECT_TRUE(IsWhole(out_));
}

TEST_F(LogMergeTest, LogsThatOverlapAreInOrderOfLogTime) {
  WriteLog(a_);
  WriteLog(b_, {.compression = mcap::Compression::kLz4, .shift_ns = 3'050'000'000, .note = "second"});
  LogDoes({"merge", a_, b_, "-o", out_});
  auto expected = MessagesIn(a_);
  std::ranges::copy(MessagesIn(b_), std::back_inserter(expected));
  std::ranges::stable_sort(expected, {}, &LoggedMessage::log_time_ns);
  EXPECT_EQ(MessagesIn(out_), expected);
  EXPECT_EQ(OpenLog(out_)->chunk_indexes().front().compression, "zstd") << "as the first log's";
  // The same configuration once, the notes both.
  EXPECT_THAT(AttachmentsIn(out_), ElementsAre(Pair("taclinkd.yaml", "arm: {}"), Pair("note.txt", "first"),
                                               Pair("note.txt", "second")));
  ASSERT_EQ(MetadataIn(out_).size(), 2u);
  EXPECT_EQ(MetadataIn(out_)[1].metadata.at("note"), "second");
  EXPECT_TRUE(IsWhole(out_));
}

TEST_F(LogMergeTest, WhatDiffersIsKeptApart) {
  const mcap::Schema schema{.name = "Thing", .encoding = "jsonschema", .data = "{}"};
  mcap::Schema other_schema = schema;
  other_schema.data = "{\"type\": \"object\"}";
  const mcap::Channel channel{.topic = "/thing", .message_encoding = "json"};
  mcap::Channel other_metadata = channel;
  other_metadata.metadata["link"] = "upper";
  const std::string c = Path("c.mcap"), d = Path("d.mcap");
  WriteOne(a_, schema, channel, 40);
  WriteOne(b_, other_schema, channel, 30);
  WriteOne(c, schema, other_metadata, 20);
  WriteOne(d, schema, channel, 10);
  LogDoes({"merge", a_, b_, c, d, "-o", out_});
  const auto merged = OpenLog(out_);
  EXPECT_EQ(merged->schemas().size(), 2u);
  EXPECT_EQ(merged->channels().size(), 3u);
  std::vector<std::string> data;
  for (const LoggedMessage& message : MessagesIn(out_)) {
    data.push_back(message.data);
    EXPECT_EQ(message.sequence, 5u);
  }
  EXPECT_THAT(data, ElementsAre(d, c, b_, a_));
}

TEST_F(LogMergeTest, ATruncatedLogGivesWhatIsIntact) {
  WriteLog(a_);
  const std::string torn = Truncated(a_, 0.5), nothing = Truncated(torn, 0.004);
  const Finished run = Log({"merge", a_, torn, nothing, "-o", out_});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, AllOf(HasSubstr(torn), HasSubstr(nothing), HasSubstr("taclink log recover")));
  EXPECT_GT(MessagesIn(out_).size(), MessagesIn(a_).size());
  EXPECT_LT(MessagesIn(out_).size(), 2 * MessagesIn(a_).size());
  EXPECT_EQ(Log({"merge", nothing, nothing, "-o", Path("none.mcap")}).exit_code, 1);
  EXPECT_FALSE(Exists("none.mcap"));
}

TEST_F(LogMergeTest, WhatCannotBeIsRefused) {
  WriteLog(a_);
  const Finished missing = Log({"merge", a_, Path("none.mcap"), "-o", out_});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.err, HasSubstr("none.mcap"));
  EXPECT_FALSE(Exists("out.mcap"));
  EXPECT_EQ(Log({"merge", a_, "-o", a_}).exit_code, 1);
  EXPECT_EQ(Log({"merge", "-o", out_}).exit_code, 2);
}

}  // namespace
}  // namespace taclink::testing

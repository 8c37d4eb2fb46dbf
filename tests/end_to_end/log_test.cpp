// taclink log, on small logs of the fuzz targets' corpus.
#include <gmock/gmock.h>

#include <filesystem>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class LogTest : public ScratchFolder {
 protected:
  static std::string Log(const std::string& name) { return FuzzLog(name); }
};

TEST_F(LogTest, InfoTellsWhatALogHolds) {
  const Finished run = Taclink({"log", "info", "--json", Log("zstd")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json info = json::parse(run.out);
  EXPECT_EQ(info.at("problem"), "");
  EXPECT_GT(info.at("messages"), 0);
  uint64_t messages = 0;
  for (const json& channel : info.at("channels")) messages += channel.at("messages").get<uint64_t>();
  EXPECT_EQ(info.at("messages"), messages);
  const Finished text = Taclink({"log", "info", Log("zstd")});
  EXPECT_THAT(text.out,
              AllOf(HasSubstr(info.at("channels")[0].at("topic").get<std::string>()), HasSubstr(" UTC")));
}

TEST_F(LogTest, ATornLogIsSaidToBeAndIsMended) {
  const Finished torn = Taclink({"log", "check", Log("truncated")});
  EXPECT_EQ(torn.exit_code, 1);
  EXPECT_THAT(torn.err, HasSubstr("log recover"));
  const std::string mended = Path("mended.mcap");
  const Finished run = Taclink({"log", "recover", Log("truncated"), "-o", mended});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const Finished checked = Taclink({"log", "check", mended});
  EXPECT_EQ(checked.exit_code, 0) << checked.out << checked.err;
  EXPECT_THAT(checked.out, HasSubstr("good"));
  EXPECT_THAT(run.out, HasSubstr("% of the bytes were intact"));
  const std::string nothing = Write("nothing", std::string(5000, 'x'));
  const Finished none = Taclink({"log", "recover", nothing, "-o", nothing + ".new"});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("no message in it is intact"));
  EXPECT_FALSE(std::filesystem::exists(nothing + ".new"));
  const Finished again = Taclink({"log", "recover", Log("truncated"), "-o", mended});
  EXPECT_EQ(again.exit_code, 1) << "it is there already";
  EXPECT_THAT(again.err, HasSubstr("mended.mcap"));
}

TEST_F(LogTest, WhatIsNoLogIsRefused) {
  const Finished missing = Taclink({"log", "info", Path("none.mcap")});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.err, HasSubstr("none.mcap"));
  const Finished text = Taclink({"log", "info", Write("text.mcap", "this is no log")});
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.err, HasSubstr("text.mcap"));
}

}  // namespace
}  // namespace taclink::testing

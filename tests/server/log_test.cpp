#include "server/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <limits>
#include <sstream>
#include <thread>

namespace taclink::server {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A sink, whose messages have the time that the test says.
class LogTest : public testing::Test {
 protected:
  std::vector<std::string> Lines() {
    std::vector<std::string> lines;
    std::istringstream in(text_.str());
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    text_.str("");
    return lines;
  }
  void Log(spdlog::sinks::sink& sink, const std::string& text,
           spdlog::level::level_enum level = spdlog::level::warn) {
    spdlog::details::log_msg msg("", level, text);
    msg.time = now_;
    sink.log(msg);
  }

  std::ostringstream text_;
  const std::shared_ptr<spdlog::sinks::sink> plain_ =
      std::make_shared<spdlog::sinks::ostream_sink_mt>(text_, true);
  spdlog::log_clock::time_point now_{seconds(1'790'000'000) + std::chrono::milliseconds(7)};
};

TEST_F(LogTest, JsonHasWhatTheMessageIsAbout) {
  plain_->set_formatter(JsonLines());
  {
    const LogEvent event("stage_overdue",
                         {{"limit_s", 0.5}, {"nan", std::numeric_limits<double>::quiet_NaN()}});
    Log(*plain_, "link arm-1: it \"hangs\"\n\\");
  }
  Log(*plain_, "no link here: x", spdlog::level::info);
  EXPECT_THAT(Lines(),
              ElementsAre(R"({"ts":"2026-09-21T14:13:20.007Z","level":"warning","link":"arm-1",)"
                          R"("event":"stage_overdue","message":"it \"hangs\"\u000a\\","limit_s":0.5})",
                          R"({"ts":"2026-09-21T14:13:20.007Z","level":"info","message":"no link here: x"})"));
}

TEST_F(LogTest, EventsNest) {
  EXPECT_EQ(LogEvent::Current(), nullptr);
  const LogEvent outer("outer");
  {
    const LogEvent inner("inner");
    EXPECT_STREQ(LogEvent::Current()->name(), "inner");
  }
  EXPECT_STREQ(LogEvent::Current()->name(), "outer");
}

TEST_F(LogTest, AFaultInEveryFrameIsToldAndThenCounted) {
  plain_->set_pattern("%v");
  const auto limited = LimitRate(plain_, 3);
  for (int frame = 1; frame <= 156; ++frame) Log(*limited, fmt::format("link a: frame {} is short", frame));
  Log(*limited, "link b: frame 1 is short");
  Log(*limited, "link a: something else");
  EXPECT_THAT(Lines(),
              ElementsAre("link a: frame 1 is short", "link a: frame 2 is short", "link a: frame 3 is short",
                          "link b: frame 1 is short", "link a: something else"));
  now_ += seconds(61);
  Log(*limited, "another minute");
  EXPECT_THAT(Lines(), ElementsAre("link a: frame 156 is short (suppressed 153 times)", "another minute"));
  Log(*limited, "link a: frame 157 is short");
  EXPECT_THAT(Lines(), ElementsAre("link a: frame 157 is short"));
}

TEST_F(LogTest, LinksThatDifferInANumberAreNotOne) {
  plain_->set_pattern("%v");
  const auto limited = LimitRate(plain_, 1);
  Log(*limited, "link arm1: lost");
  Log(*limited, "link arm2: lost");
  Log(*limited, "link arm2: lost");
  EXPECT_THAT(Lines(), ElementsAre("link arm1: lost", "link arm2: lost"));
}

TEST_F(LogTest, WhatWasSwallowedIsToldAtTheNextFlush) {
  plain_->set_pattern("%v");
  now_ = spdlog::log_clock::now() - seconds(120);  // a flush takes the real time
  const auto limited = LimitRate(plain_, 1);
  Log(*limited, "once");
  Log(*limited, "once");
  limited->flush();
  EXPECT_EQ(Lines().size(), 2u);
}

TEST_F(LogTest, NoLimitPassesAll) {
  EXPECT_EQ(LimitRate(plain_, 0), plain_);
}

TEST_F(LogTest, MayBeSetUpAnewWhileThreadsTell) {
  const auto before = spdlog::default_logger();
  const std::string file = testing::TempDir() + "set_up_anew." + std::to_string(::getpid());
  ASSERT_TRUE(SetUpLog({.file = file, .rate_limit = 0}).ok());
  std::atomic<int> told = 0;
  std::atomic<bool> stop = false;
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 3; ++i) {
      threads.emplace_back([&] {
        while (!stop) spdlog::info("told {}", ++told);
      });
    }
    for (int round = 0; round < 200 || told < 1000; ++round)
      EXPECT_TRUE(SetUpLog({.file = file, .rate_limit = round % 2}).ok());
    stop = true;
  }
  spdlog::set_default_logger(before);
  std::filesystem::remove(file);
}

TEST_F(LogTest, AFileThatCannotBeWrittenIsAnError) {
  const auto before = spdlog::default_logger();
  const auto result = SetUpLog({.file = "/dev/null/log"});
  ASSERT_FALSE(result.ok());
  EXPECT_THAT(result.error().message, HasSubstr("/dev/null/log"));
  EXPECT_EQ(spdlog::default_logger(), before) << "the old one stays";
}

}  // namespace
}  // namespace taclink::server

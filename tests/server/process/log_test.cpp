#include "server/process/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <thread>

#include "sensing/core/printable.h"

namespace taclink::server {
namespace {

using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// A number without digits.
std::string Letters(int number) {
  std::string out;
  do {
    out += static_cast<char>('a' + number % 26);
  } while ((number /= 26) > 0);
  return out;
}

/// A sink, whose messages have the time that the test says.
class LogTest : public ::testing::Test {
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
    LogAt(0, sink, text, level);
  }
  /// `line` of a source file; 0: the message does not tell.
  void LogAt(int line, spdlog::sinks::sink& sink, const std::string& text,
             spdlog::level::level_enum level = spdlog::level::warn) {
    spdlog::details::log_msg msg("", level, text);
    if (line > 0) msg.source = {"file.cpp", line, "Function"};
    msg.time = now_;
    sink.log(msg);
  }
  std::shared_ptr<spdlog::sinks::sink> Limited(const LogRates& rates) {
    plain_->set_pattern("%v");
    return LimitRate(plain_, rates);
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
  const auto limited = Limited({.per_site = 3});
  for (int frame = 1; frame <= 156; ++frame) Log(*limited, fmt::format("link a: frame {} is short", frame));
  Log(*limited, "link b: frame 1 is short");
  Log(*limited, "link a: something else");
  EXPECT_THAT(Lines(),
              ElementsAre("link a: frame 1 is short", "link a: frame 2 is short", "link a: frame 3 is short",
                          "link b: frame 1 is short", "link a: something else"));
  now_ += seconds(61);
  Log(*limited, "another minute");
  EXPECT_THAT(Lines(), ElementsAre("link a: frame 156 is short (… 153 more)", "another minute"));
  Log(*limited, "link a: frame 157 is short");
  EXPECT_THAT(Lines(), ElementsAre("link a: frame 157 is short"));
}

TEST_F(LogTest, LinksThatDifferInANumberAreNotOne) {
  const auto limited = Limited({.per_site = 1});
  Log(*limited, "link arm1: lost");
  Log(*limited, "link arm2: lost");
  Log(*limited, "link arm2: lost");
  EXPECT_THAT(Lines(), ElementsAre("link arm1: lost", "link arm2: lost"));
}

TEST_F(LogTest, WhatWasSwallowedIsToldAtTheNextFlush) {
  now_ = spdlog::log_clock::now() - seconds(120);  // a flush takes the real time
  const auto limited = Limited({.per_site = 1});
  Log(*limited, "once");
  Log(*limited, "once");
  limited->flush();
  EXPECT_EQ(Lines().size(), 2u);
}

TEST_F(LogTest, OnePlaceAboutOneSourceIsLimitedWhateverItSays) {
  const auto limited = Limited({.per_site = 3});
  for (int call = 0; call < 1234 + 3; ++call)
    LogAt(1, *limited, fmt::format("ipv4:10.0.0.{}:{}: no link {}", 5, 40000 + call, Letters(call)));
  EXPECT_EQ(Lines().size(), 3u);
  LogAt(1, *limited, "ipv4:10.0.0.6:40000: no link a");
  LogAt(2, *limited, "ipv4:10.0.0.5:40000: another matter");
  LogAt(1, *limited, "link a: the same place");
  LogAt(1, *limited, "link b: the same place");
  EXPECT_EQ(Lines().size(), 4u);
  now_ += seconds(61);
  Log(*limited, "another minute");
  EXPECT_THAT(Lines(), ElementsAre(HasSubstr(Letters(1236) + " (… 1,234 more)"), "another minute"));
}

TEST_F(LogTest, AFloodFromEverywhereIsBounded) {
  const auto limited = Limited({.per_site = 10, .total = 100});
  for (int call = 0; call < 5000; ++call) {
    LogAt(1, *limited, fmt::format("ipv6:[2001:db8::{}]:7: refused", Letters(call)));
    Log(*limited, Letters(call) + " has no place in the program and no numbers");
  }
  EXPECT_EQ(Lines().size(), 100u);
  now_ += seconds(61);
  Log(*limited, "another minute");
  const auto told = Lines();
  EXPECT_LE(told.size(), 102u);
  EXPECT_EQ(told.back(), "another minute");
  EXPECT_THAT(told.at(told.size() - 2), AllOf(StartsWith("… "), HasSubstr(" other kinds")));
}

TEST_F(LogTest, NoMessageIsUncounted) {
  constexpr int kMessages = 3000;
  const auto limited = Limited({.per_site = 2, .total = 10});
  for (int i = 0; i < kMessages; ++i) LogAt(i % 7 + 1, *limited, fmt::format("link {}: x", Letters(i % 500)));
  now_ += seconds(61);
  Log(*limited, "another minute");
  int counted = -1;  // the last line is of another minute
  for (std::string line : Lines()) {
    std::erase(line, ',');
    const auto at = line.find("… ");
    counted += at == std::string::npos ? 1 : std::stoi(line.substr(at + std::string_view("… ").size()));
  }
  EXPECT_EQ(counted, kMessages);
}

TEST_F(LogTest, AFloodHidesNeitherAnotherPlaceNorAnotherLinksError) {
  const auto limited = Limited({.per_site = 10, .total = 100});
  for (int call = 0; call < 5000; ++call)
    LogAt(1, *limited, fmt::format("ipv4:10.{}.{}.1:7: refused", call / 100, call % 100),
          spdlog::level::info);
  EXPECT_EQ(Lines().size(), 75u);
  LogAt(2, *limited, "link a: frames arrive", spdlog::level::info);
  LogAt(3, *limited, "link a: its worker failed", spdlog::level::err);
  LogAt(3, *limited, "link b: its worker failed", spdlog::level::err);
  LogAt(2, *limited, "link b: frames arrive", spdlog::level::info);
  EXPECT_THAT(Lines(),
              ElementsAre("link a: frames arrive", "link a: its worker failed", "link b: its worker failed"));
  for (int call = 0; call < 5000; ++call)
    LogAt(3, *limited, fmt::format("link {}: its worker failed", Letters(call)), spdlog::level::err);
  EXPECT_EQ(Lines().size(), 22u);
  LogAt(4, *limited, "a new kind of error", spdlog::level::err);
  EXPECT_THAT(Lines(), ElementsAre("a new kind of error"));
}

TEST_F(LogTest, AClockThatIsSetBackBeginsAnotherMinute) {
  const auto limited = Limited({.per_site = 1});
  Log(*limited, "once");
  Log(*limited, "once");
  now_ -= std::chrono::hours(24);
  Log(*limited, "once");
  EXPECT_THAT(Lines(), ElementsAre("once", "once (… 1 more)", "once"));
}

TEST_F(LogTest, WhatWasSwallowedIsToldAtTheEnd) {
  auto limited = Limited({.per_site = 1});
  for (int i = 0; i < 3; ++i) Log(*limited, "once");
  limited.reset();
  EXPECT_THAT(Lines(), ElementsAre("once", "once (… 2 more)"));
}

TEST_F(LogTest, ACountIsOfItsOwnEventAndNotOfTheNextMessages) {
  plain_->set_formatter(JsonLines());
  const auto limited = LimitRate(plain_, {.per_site = 1});
  for (int i = 0; i < 3; ++i) {
    const LogEvent event("first", {{"limit_s", 1}});
    Log(*limited, "link a: x");
  }
  now_ += seconds(61);
  const LogEvent event("second", {{"deaths", 2}});
  Log(*limited, "y");
  constexpr const char* kCount = R"-("link":"a","event":"first","message":"x (… 2 more)","more":2})-";
  EXPECT_THAT(Lines(), ElementsAre(HasSubstr(R"("limit_s":1)"), HasSubstr(kCount),
                                   HasSubstr(R"("event":"second","message":"y","deaths":2})")));
}

// A terminal that shows the log, and a program that reads it line by line, see no more than text.
TEST_F(LogTest, ForeignTextIsEscaped) {
  const std::string foreign =
      "\x1b[2J\n2026-09-21 error forged\r\x7f\xc2\x9b\xff\xe2\x80\xa8\xe2\x80\xae \"°\"";
  plain_->set_formatter(TextLines());
  Log(*plain_, foreign);
  EXPECT_THAT(Lines(),
              ElementsAre(AllOf(
                  StartsWith("2026-09-21T"),
                  EndsWith(R"( warning \x1b[2J\n2026-09-21 error forged\r\x7f\u009b\xff\u2028\u202e "°")"))));
  plain_->set_formatter(JsonLines());
  Log(*plain_, foreign);
  EXPECT_THAT(
      Lines(),
      ElementsAre(HasSubstr(
          R"("message":"\u001b[2J\u000a2026-09-21 error forged\u000d\u007f\u009b\\xff\u2028\u202e \"°\"")")));
}

TEST_F(LogTest, WhateverBytesComeAreOneLineAndJson) {
  std::mt19937 random(1);
  for (const bool json : {false, true}) {
    plain_->set_formatter(json ? JsonLines() : TextLines());
    for (int i = 0; i < 2000; ++i) {
      std::string bytes = i % 2 == 0 ? "link " : "";
      for (size_t n = random() % 40; n > 0; --n) bytes += static_cast<char>(random());
      Log(*plain_, bytes);
      const auto lines = Lines();
      ASSERT_EQ(lines.size(), 1u);
      EXPECT_TRUE(IsUtf8(lines[0]));
      for (std::string_view rest = lines[0]; !rest.empty(); rest.remove_prefix(FirstPiece(rest).bytes.size()))
        EXPECT_FALSE(IsControl(*FirstPiece(rest).code)) << lines[0];
      EXPECT_TRUE(!json || nlohmann::json::accept(lines[0])) << lines[0];
    }
  }
}

TEST_F(LogTest, AHugeMessageIsCut) {
  for (const bool json : {false, true}) {
    plain_->set_formatter(json ? JsonLines() : TextLines());
    Log(*plain_, std::string(60'000, 'x'));
    const auto lines = Lines();
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_LT(lines[0].size(), 4300u);
    EXPECT_THAT(lines[0], HasSubstr("xx… 55,904 bytes more"));
  }
}

TEST_F(LogTest, TheMacrosTellTheirPlace) {
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", Limited({.per_site = 1})));
  for (int i = 0; i < 100; ++i) SPDLOG_WARN("{}", Letters(i));
  spdlog::set_default_logger(before);
  spdlog::drop("test");  // from spdlog 1.15 on, a former default logger stays registered
  EXPECT_EQ(Lines().size(), 2u) << "and the count";
}

TEST_F(LogTest, NoLimitPassesAll) {
  EXPECT_EQ(LimitRate(plain_, {.per_site = 0, .total = 0}), plain_);
}

TEST_F(LogTest, MayBeSetUpAnewWhileThreadsTell) {
  const auto before = spdlog::default_logger();
  const std::string file = ::testing::TempDir() + "set_up_anew." + std::to_string(::getpid());
  ASSERT_TRUE(SetUpLog({.file = file, .rates = {.per_site = 0, .total = 0}}).ok());
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
      EXPECT_TRUE(SetUpLog({.file = file, .rates = {.per_site = round % 2}}).ok());
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

#include "server/assembly/reload.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Config Parse(const std::string& sections) {
  const auto config = ParseConfig("arm.yaml",
                                  "taclink_config: 1\n" + sections +
                                      "arm:\n  name: x\n  links:\n"
                                      "    - {name: a, model: cylinder, source: simulated, scene: press}\n",
                                  "");
  EXPECT_TRUE(config.ok()) << config.error().message;
  return *config;
}

TEST(Reload, WhatHasAHookIsTakenOverAndTheRestNamed) {
  Reloader reloader(Parse(""));
  int streams = 0, always = 0;
  reloader.Add("limits", [&](const Config& next) {
    streams = next.limits.max_streams;
    return Result<void>();
  });
  reloader.AddAlways("certificates", [&](const Config&) {
    ++always;
    return Result<void>();
  });
  const auto outcome = reloader.Reload(Parse("limits: {max_streams: 7}\nserver: {listen: '[::1]:1'}\n"));
  EXPECT_THAT(outcome.applied, ElementsAre("limits"));
  EXPECT_THAT(outcome.needs_restart, ElementsAre("server"));
  EXPECT_THAT(outcome.keys, ElementsAre("server.listen", "limits.max_streams"));
  EXPECT_EQ(streams, 7);

  // Again: the limits are in use now, the address still is not.
  const auto again = reloader.Reload(Parse("limits: {max_streams: 7}\nserver: {listen: '[::1]:1'}\n"));
  EXPECT_THAT(again.applied, IsEmpty());
  EXPECT_THAT(again.needs_restart, ElementsAre("server"));
  EXPECT_THAT(again.keys, IsEmpty()) << "since the last reload";
  EXPECT_THAT(reloader.Reload(Parse("")).applied, ElementsAre("limits"));
  EXPECT_EQ(streams, 64);
  EXPECT_EQ(always, 3);
}

TEST(Reload, KeysOfASectionThatNeedARestartAreNamed) {
  Reloader reloader(Parse(""));
  reloader.Add("limits", [](const Config&) { return Result<void>(); }, {"memory_mb", "max_links"});
  const auto outcome = reloader.Reload(Parse("limits: {max_streams: 7, memory_mb: 99}\n"));
  EXPECT_THAT(outcome.applied, ElementsAre("limits"));
  EXPECT_THAT(outcome.needs_restart, ElementsAre("limits.memory_mb"));
}

TEST(Reload, WhatFailsIsToldAndTriedAgain) {
  Reloader reloader(Parse(""));
  int tries = 0;
  reloader.Add("log", [&](const Config&) -> Result<void> {
    return ++tries == 1 ? Result<void>(Error{ErrorCode::kUnavailable, "no such folder"}) : Result<void>();
  });
  const Config next = Parse("log: {level: debug}\n");
  EXPECT_THAT(reloader.Reload(next).errors, ElementsAre(HasSubstr("log: no such folder")));
  EXPECT_THAT(reloader.Reload(next).applied, ElementsAre("log"));
}

// As the log's: its file is opened again by each reload.
TEST(Reload, ASectionThatIsAlwaysAppliedIsReportedByWhatBecameOfIt) {
  Reloader reloader(Parse(""));
  int calls = 0;
  bool refuse = false;
  reloader.Add(
      "log",
      [&](const Config&) -> Result<void> {
        ++calls;
        return refuse ? Result<void>(Error{ErrorCode::kUnavailable, "/no/such: no such folder"})
                      : Result<void>();
      },
      {}, Reloader::When::kAlways);
  const Config same = Parse(""), next = Parse("log: {file: /no/such/log}\n");
  const auto unchanged = reloader.Reload(same);
  EXPECT_EQ(calls, 1);
  EXPECT_THAT(unchanged.applied, IsEmpty());
  EXPECT_THAT(unchanged.errors, IsEmpty());

  refuse = true;
  const auto refused = reloader.Reload(next);
  EXPECT_THAT(refused.applied, IsEmpty());
  EXPECT_THAT(refused.errors, ElementsAre("log: /no/such: no such folder"));
  EXPECT_THAT(refused.keys, ElementsAre("log.file"));
  EXPECT_THAT(reloader.Reload(same).errors, ElementsAre(HasSubstr("no such folder")))
      << "unchanged, but refused";
  EXPECT_EQ(calls, 3);

  refuse = false;
  EXPECT_THAT(reloader.Reload(next).applied, ElementsAre("log"));
  EXPECT_THAT(reloader.Reload(next).applied, IsEmpty());
}

TEST(Reload, SectionsOfAPrintedConfigurationAreAllThere) {
  const std::string text = ConfigText(Parse(""));
  std::string joined;
  for (const auto& [name, section] : Sections(text)) joined += section;
  EXPECT_EQ(joined, text);
}

TEST(ConfigOperations, ReadPrintedAndRefused) {
  const Config config = Parse(
      "log: {level: error, format: json, file: '/var/log/a \"b\"', rate_limit: 0, rate_limit_total: "
      "7}\nshutdown: {limit_s: "
      "0.5}\n");
  EXPECT_EQ(config.log.format, LogFormat::kJson);
  EXPECT_EQ(config.log.rates.per_site, 0);
  EXPECT_EQ(config.log.rates.total, 7);
  EXPECT_EQ(config.shutdown.limit, std::chrono::milliseconds(500));
  const auto again = ParseConfig("printed", ConfigText(config), "");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(ConfigText(*again), ConfigText(config));
  EXPECT_EQ(again->log.file, "/var/log/a \"b\"");
  const auto bad = ParseConfig("arm.yaml", "taclink_config: 1\nlog: {level: loud}\narm: {name: a}\n", "");
  EXPECT_THAT(bad.error().message, HasSubstr("debug, info, warning, error"));
  const auto relative = ParseConfig("arm.yaml", "taclink_config: 1\nlog: {file: x}\narm: {name: a}\n", "");
  EXPECT_THAT(relative.error().message, HasSubstr("absolute"));
}

}  // namespace
}  // namespace taclink::server

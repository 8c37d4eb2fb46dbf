#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/config/config.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Result<Config> ParseWatchdog(const std::string& sections, const std::string& of_link = "") {
  return ParseConfig("arm.yaml",
                     "taclink_config: 1\n" + sections +
                         "arm:\n  name: x\n  links:\n"
                         "    - {name: a, model: cylinder, source: simulated, scene: press" +
                         of_link +
                         "}\n"
                         "    - {name: b, model: cylinder, source: simulated, scene: press}\n",
                     "");
}

std::string WatchdogComplaint(const std::string& sections, const std::string& of_link = "") {
  const auto config = ParseWatchdog(sections, of_link);
  return config.ok() ? "accepted" : config.error().message;
}

TEST(ConfigWatchdog, SaysWhatDiffersFromTheDefaults) {
  const auto config = ParseWatchdog("watchdog: {frame_s: 0.25, deaths: 5}\n");
  ASSERT_TRUE(config.ok()) << config.error().message;
  EXPECT_EQ(config->watchdog.frame, milliseconds(250));
  EXPECT_EQ(config->watchdog.deaths, 5);
  EXPECT_EQ(config->watchdog.source_start, WatchdogOptions{}.source_start);
}

TEST(ConfigWatchdog, LinksInheritRealtime) {
  const auto config =
      ParseWatchdog("realtime: {priority: 20, cpus: [3, 2, 3]}\n", ", realtime: {priority: 0}");
  ASSERT_TRUE(config.ok()) << config.error().message;
  EXPECT_EQ(config->links[0].realtime.priority, 0);
  EXPECT_THAT(config->links[0].realtime.cpus, ElementsAre(2, 3));
  EXPECT_EQ(config->links[1].realtime.priority, 20);
  EXPECT_THAT(ParseWatchdog("")->links[1].realtime.cpus, IsEmpty());
}

TEST(ConfigWatchdog, PrintedReadsBackToTheSame) {
  const auto config = ParseWatchdog("watchdog: {frame_s: 0.123, proven_s: 7}\nrealtime: {cpus: [1]}\n",
                                    ", realtime: {priority: 3, cpus: [0, 5]}");
  ASSERT_TRUE(config.ok()) << config.error().message;
  const std::string text = ConfigText(*config);
  const auto again = ParseConfig("printed", text, "");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(ConfigText(*again), text);
  EXPECT_EQ(again->watchdog.frame, milliseconds(123));
  EXPECT_THAT(again->links[0].realtime.cpus, ElementsAre(0, 5));
}

TEST(ConfigWatchdog, MistakesAreNamed) {
  EXPECT_THAT(WatchdogComplaint("watchdog: {frame_s: 0}\n"), HasSubstr("arm.yaml:2: 'watchdog.frame_s'"));
  EXPECT_THAT(WatchdogComplaint("watchdog: {frame: 1}\n"), HasSubstr("'watchdog.frame' is not a known key"));
  EXPECT_THAT(WatchdogComplaint("watchdog: {abandon_s: 0.5}\n"), HasSubstr("must not be shorter"));
  EXPECT_THAT(WatchdogComplaint("realtime: {priority: 100}\n"), HasSubstr("realtime.priority"));
  EXPECT_THAT(WatchdogComplaint("realtime: {cpus: [0.5]}\n"), HasSubstr("whole numbers"));
  EXPECT_THAT(WatchdogComplaint("realtime: {cpus: [-1]}\n"), HasSubstr("realtime.cpus"));
  EXPECT_THAT(WatchdogComplaint("", ", realtime: {cpus: all}"), HasSubstr("arm.links[0].realtime.cpus"));
}

}  // namespace
}  // namespace taclink::server

#include "sensing/yaml/yaml_changes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(YamlChanges, NamesKeysAndNoValues) {
  const char* const before =
      "log: {level: info}\nlimits: {a: 1, b: 2}\narm: {name: x, links: [{name: base, gain: 1}, {name: tip, "
      "cpus: [1, 2]}]}\n";
  EXPECT_THAT(ChangedKeys(before, before), IsEmpty());
  EXPECT_THAT(
      ChangedKeys(before,
                  "log: {level: debug}\nlimits: {a: 1, b: 2, c: 3}\narm: {name: x, links: [{name: base, "
                  "gain: 2}, {name: tip, cpus: [1, 3]}]}\n"),
      ElementsAre("log.level", "limits.c", "arm.links.base.gain", "arm.links.tip.cpus"));
  EXPECT_THAT(
      ChangedKeys(before,
                  "log: {level: info}\nhttp: {x: 1}\narm: {name: x, links: [{name: tip, cpus: [1, 2]}]}\n"),
      ElementsAre("limits", "arm.links.base", "http"));
  EXPECT_THAT(ChangedKeys("a: 1\n", "a: {b: 1}\n"), ElementsAre("a"));
}

}  // namespace
}  // namespace taclink

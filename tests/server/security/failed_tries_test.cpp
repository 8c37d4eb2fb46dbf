#include "server/security/failed_tries.h"

#include <gtest/gtest.h>

#include <string>

namespace taclink::server {
namespace {

constexpr int64_t kMinuteNs = 60'000'000'000;

TEST(FailedTriesTest, MemoryIsBoundedWhereverTheyComeFrom) {
  FailedTries tries(1);
  int passed = 0;
  for (int i = 0; i < 100'000; ++i) passed += tries.Count("place " + std::to_string(i), 1).too_many ? 0 : 1;
  EXPECT_EQ(tries.places(), 1024u);
  EXPECT_EQ(passed, 1025) << "what has no room counts as one";
  EXPECT_EQ(tries.throttled(), 100'000u - 1025u);
  EXPECT_FALSE(tries.Count("another", 1 + kMinuteNs).too_many) << "the old ones make room";
  EXPECT_EQ(tries.places(), 1u);
}

TEST(FailedTriesTest, IsToldOnceAMinuteInAll) {
  FailedTries tries(1);
  int told = 0;
  for (int64_t second = 0; second < 180; ++second) {
    for (int i = 0; i < 50; ++i)
      told += tries.Count("place " + std::to_string(i), second * 1'000'000'000).tell ? 1 : 0;
  }
  EXPECT_EQ(told, 3);
}

TEST(FailedTriesTest, NoLimitCountsNothing) {
  FailedTries tries(0);
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(tries.Count("here", 1).too_many);
  EXPECT_EQ(tries.places(), 0u);
}

}  // namespace
}  // namespace taclink::server

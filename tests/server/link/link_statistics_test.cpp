#include "server/link/link_statistics.h"

#include <gtest/gtest.h>

#include "tests/support/times.h"

namespace taclink::server {
namespace {

TEST(LinkStatistics, EmptyIsZero) {
  const auto statistics = LinkStatisticsCollector().Snapshot(0);
  EXPECT_EQ(statistics.rate_hz, 0);
  EXPECT_EQ(statistics.latency_p99_ms, 0);
}

TEST(LinkStatistics, PercentilesOfTheLastFrames) {
  LinkStatisticsCollector collector;
  for (int i = 0; i < 1000; ++i) collector.Record(static_cast<uint64_t>(i), 0, 900 * kMs);  // pushed out
  for (int i = 1; i <= 300; ++i) {
    const int64_t published = 10'000 * kMs + i * 10 * kMs;
    collector.Record(static_cast<uint64_t>(1000 + i), published - i * kMs, published);
  }
  const auto statistics = collector.Snapshot(13'000 * kMs);
  EXPECT_DOUBLE_EQ(statistics.latency_p50_ms, 150);
  EXPECT_DOUBLE_EQ(statistics.latency_p99_ms, 297);
  EXPECT_NEAR(statistics.rate_hz, 100, 1e-9);
  EXPECT_EQ(statistics.frames, 1300u);
  EXPECT_EQ(statistics.frames_skipped, 1u);
}

TEST(LinkStatistics, ASourceThatStoppedHasNoRate) {
  LinkStatisticsCollector collector;
  for (int i = 0; i < 60; ++i) collector.Record(static_cast<uint64_t>(i), 0, i * 33 * kMs);
  EXPECT_NEAR(collector.Snapshot(1950 * kMs).rate_hz, 1000.0 / 33, 0.01);
  EXPECT_EQ(collector.Snapshot(10'000 * kMs).rate_hz, 0);
}

TEST(LinkStatistics, BadPicturesAreCountedByCamera) {
  LinkStatisticsCollector collector;
  std::array<CameraCounts, kCameraCount> cameras;
  collector.RecordPictures(cameras);
  cameras[1].bad_picture = true;
  collector.RecordPictures(cameras);
  collector.RecordPictures(cameras);
  EXPECT_EQ(collector.Snapshot(0).bad_pictures, (std::array<uint64_t, kCameraCount>{0, 2}));
}

}  // namespace
}  // namespace taclink::server

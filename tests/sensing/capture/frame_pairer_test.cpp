#include "sensing/capture/frame_pairer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/support/times.h"

namespace taclink {
namespace {

constexpr double kRateHz = 100;  // a frame is 10 ms
constexpr CameraId kTopCamera = CameraId::kTop, kBottomCamera = CameraId::kBottom;

/// A picture as it arrives from a camera.
struct Arrival {
  CameraId camera;
  PictureTag picture;
  int64_t arrives_ns;
};

struct SimulatedCamera {
  double interval_ms = 10;
  double offset_ms = 0;
  double jitter_ms = 0;   ///< standard deviation of the timestamps
  double latency_ms = 5;  ///< exposure to arrival
  double loss = 0;        ///< share of pictures that never arrive
  uint32_t first_sequence = 0;
};

std::vector<Arrival> Simulate(const SimulatedCamera& top, const SimulatedCamera& bottom, int count) {
  std::mt19937 random(7);
  std::vector<Arrival> arrivals;
  for (const CameraId id : kBothCameras) {
    const SimulatedCamera& camera = id == kTopCamera ? top : bottom;
    std::normal_distribution<double> jitter(0, 1);
    std::uniform_real_distribution<double> chance;
    for (int i = 0; i < count; ++i) {
      const double at_ms =
          1000 + camera.offset_ms + i * camera.interval_ms + camera.jitter_ms * jitter(random);
      const auto at_ns = static_cast<int64_t>(at_ms * 1e6);
      if (chance(random) < camera.loss) continue;
      arrivals.push_back({id,
                          {camera.first_sequence + static_cast<uint32_t>(i), at_ns, i},
                          at_ns + static_cast<int64_t>(camera.latency_ms * 1e6)});
    }
  }
  std::ranges::stable_sort(arrivals, {}, &Arrival::arrives_ns);
  return arrivals;
}

std::vector<FramePair> Pairs(FramePairer& pairer, const std::vector<Arrival>& arrivals) {
  std::vector<FramePair> pairs;
  for (const Arrival& arrival : arrivals) {
    if (const auto pair = pairer.Add(arrival.camera, arrival.picture)) pairs.push_back(*pair);
  }
  return pairs;
}

double OffsetMs(const FramePair& pair) {
  return 1e-6 * static_cast<double>(pair[kBottomCamera].timestamp_ns - pair[kTopCamera].timestamp_ns);
}

void ExpectRising(const std::vector<FramePair>& pairs) {
  for (size_t i = 1; i < pairs.size(); ++i) {
    EXPECT_GT(pairs[i].sequence, pairs[i - 1].sequence);
    for (const CameraId id : kBothCameras) {
      EXPECT_GT(pairs[i][id].timestamp_ns, pairs[i - 1][id].timestamp_ns);
    }
  }
}

TEST(FramePairer, PairsTheNearest) {
  FramePairer pairer(kRateHz);
  EXPECT_FALSE(pairer.Add(kTopCamera, {7, 100 * kMs, 1}));
  const auto pair = pairer.Add(kBottomCamera, {3, 104 * kMs, 2});
  ASSERT_TRUE(pair);
  EXPECT_EQ((*pair)[kTopCamera].handle, 1);
  EXPECT_EQ((*pair)[kBottomCamera].handle, 2);
  EXPECT_EQ(pair->exposure_ns(), 100 * kMs);
  EXPECT_TRUE(pairer.dropped().empty());
}

TEST(FramePairer, DropsTheOlderOfTwoThatDoNotMatch) {
  FramePairer pairer(kRateHz);
  EXPECT_FALSE(pairer.Add(kTopCamera, {0, 100 * kMs, 1}));
  EXPECT_FALSE(pairer.Add(kBottomCamera, {0, 106 * kMs, 2}));
  ASSERT_EQ(pairer.dropped().size(), 1u);
  EXPECT_EQ(pairer.dropped()[0].camera, kTopCamera);
  EXPECT_EQ(pairer.dropped()[0].picture.handle, 1);
  EXPECT_EQ(pairer.dropped_total(kTopCamera), 1u);
  const auto pair = pairer.Add(kTopCamera, {1, 110 * kMs, 3});
  ASSERT_TRUE(pair);
  EXPECT_NEAR(OffsetMs(*pair), -4, 1e-9);
  EXPECT_TRUE(pairer.dropped().empty());
}

TEST(FramePairer, HalfAFrameIsStillAPair) {
  FramePairer pairer(kRateHz);
  EXPECT_FALSE(pairer.Add(kTopCamera, {0, 100 * kMs, 0}));
  EXPECT_TRUE(pairer.Add(kBottomCamera, {0, 105 * kMs, 0}));
  FramePairer other(kRateHz);
  EXPECT_FALSE(other.Add(kTopCamera, {0, 100 * kMs, 0}));
  EXPECT_FALSE(other.Add(kBottomCamera, {0, 105 * kMs + 1, 0}));
}

TEST(FramePairer, AnyConstantOffsetGivesEveryPair) {
  for (double offset_ms = -40; offset_ms <= 40; offset_ms += 0.7) {
    FramePairer pairer(kRateHz);
    const auto pairs = Pairs(pairer, Simulate({}, {.offset_ms = offset_ms}, 100));
    EXPECT_GE(pairs.size(), 95u) << offset_ms;
    ExpectRising(pairs);
    for (const FramePair& pair : pairs) EXPECT_LE(std::abs(OffsetMs(pair)), 5.001) << offset_ms;
  }
}

TEST(FramePairer, DifferentLatenciesDoNotMatter) {
  for (const double latency_ms : {5.0, 9.0, 14.0, 19.0}) {
    FramePairer pairer(kRateHz);
    const auto pairs = Pairs(pairer, Simulate({}, {.offset_ms = 4, .latency_ms = latency_ms}, 100));
    EXPECT_GE(pairs.size(), 97u) << latency_ms;
    for (const FramePair& pair : pairs) EXPECT_NEAR(OffsetMs(pair), 4, 1e-3);
  }
}

TEST(FramePairer, DriftingCamerasChangeTheirPartnerAndLoseOnePicture) {
  for (const double rate : {1.002, 0.998}) {
    FramePairer pairer(kRateHz);
    const int count = 4000;  // 80 ms of drift: eight frames
    const auto pairs = Pairs(pairer, Simulate({}, {.interval_ms = 10 * rate, .jitter_ms = 0.1}, count));
    ExpectRising(pairs);
    int partner_changes = 0;
    for (size_t i = 0; i < pairs.size(); ++i) {
      EXPECT_LE(std::abs(OffsetMs(pairs[i])), 10 * (0.5 + FramePairer::kHysteresisFrames) + 0.01);
      if (i > 0) partner_changes += std::abs(OffsetMs(pairs[i]) - OffsetMs(pairs[i - 1])) > 5 ? 1 : 0;
    }
    EXPECT_EQ(partner_changes, 8) << rate;
    EXPECT_GE(pairs.size(), static_cast<size_t>(count - 2 * partner_changes - 10)) << rate;
  }
}

TEST(FramePairer, JitterAroundHalfAFrameCostsLittle) {
  FramePairer pairer(kRateHz);
  const auto pairs = Pairs(pairer, Simulate({.jitter_ms = 0.05}, {.offset_ms = 5, .jitter_ms = 0.05}, 1000));
  EXPECT_GE(pairs.size(), 990u);
  ExpectRising(pairs);
}

TEST(FramePairer, CamerasSlowerThanAskedStillPair) {
  for (double offset_ms = 0; offset_ms < 20; offset_ms += 0.9) {
    FramePairer pairer(kRateHz);  // low light: 50 a second where 100 were asked for
    const auto pairs =
        Pairs(pairer, Simulate({.interval_ms = 20}, {.interval_ms = 20, .offset_ms = offset_ms}, 200));
    EXPECT_GE(pairs.size(), 150u) << offset_ms;
    EXPECT_NEAR(pairer.frame_interval_ns(), 20e6, 1e4);
  }
}

TEST(FramePairer, OneCameraAtHalfTheRateHasAPartnerForEachPicture) {
  FramePairer pairer(kRateHz);
  const auto pairs = Pairs(pairer, Simulate({}, {.interval_ms = 20, .offset_ms = 3}, 200));
  EXPECT_GE(pairs.size(), 98u);
  for (const FramePair& pair : pairs) EXPECT_NEAR(OffsetMs(pair), 3, 1e-3);
}

TEST(FramePairer, LossesAreGapsAndEveryPictureIsAccountedFor) {
  FramePairer pairer(kRateHz);
  const auto arrivals = Simulate({.loss = 0.2}, {.offset_ms = 2, .loss = 0.1}, 2000);
  size_t dropped = 0;
  std::vector<FramePair> pairs;
  for (const Arrival& arrival : arrivals) {
    if (const auto pair = pairer.Add(arrival.camera, arrival.picture)) pairs.push_back(*pair);
    dropped += pairer.dropped().size();
  }
  ExpectRising(pairs);
  EXPECT_NEAR(static_cast<double>(pairs.size()), 2000 * 0.8 * 0.9, 60);
  for (size_t i = 1; i < pairs.size(); ++i) {
    EXPECT_EQ(pairs[i].sequence - pairs[i - 1].sequence,
              pairs[i][kTopCamera].sequence - pairs[i - 1][kTopCamera].sequence);
    EXPECT_NEAR(OffsetMs(pairs[i]), 2, 1e-3);
  }
  EXPECT_EQ(dropped, pairer.dropped_total(kTopCamera) + pairer.dropped_total(kBottomCamera));
  EXPECT_LE(arrivals.size() - 2 * pairs.size() - dropped, FramePairer::kDepth);  // these still wait
}

TEST(FramePairer, ASilentCameraFillsNothing) {
  FramePairer pairer(kRateHz);
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(pairer.Add(kTopCamera, {static_cast<uint32_t>(i), i * 10 * kMs, i}));
    ASSERT_EQ(pairer.dropped().size(), i < 2 ? 0u : 1u);
    if (i >= 2) {
      EXPECT_EQ(pairer.dropped()[0].picture.handle, i - 2);
    }
  }
  const auto pair = pairer.Add(kBottomCamera, {0, 991 * kMs, 0});
  ASSERT_TRUE(pair);
  EXPECT_EQ((*pair)[kTopCamera].handle, 99);
}

TEST(FramePairer, SequenceRisesAcrossTheDriversWrap) {
  FramePairer pairer(kRateHz);
  const auto pairs = Pairs(pairer, Simulate({.first_sequence = 0xffffffffu - 10}, {}, 40));
  ASSERT_EQ(pairs.size(), 40u);
  EXPECT_EQ(pairs.back().sequence - pairs.front().sequence, 39u);
  ExpectRising(pairs);
}

TEST(FramePairer, ADriverWithoutSequenceIsCountedByTime) {
  FramePairer pairer(kRateHz);
  std::vector<FramePair> pairs;
  for (const int frame : {0, 1, 2, 5, 6}) {
    EXPECT_FALSE(pairer.Add(kTopCamera, {0, frame * 10 * kMs, 0}));
    pairs.push_back(pairer.Add(kBottomCamera, {0, frame * 10 * kMs + kMs, 0}).value());
  }
  EXPECT_EQ(pairs[3].sequence - pairs[2].sequence, 3u);
  EXPECT_EQ(pairs[4].sequence - pairs[0].sequence, 6u);
}

TEST(FramePairer, ANewStartGoesOnWithAGapOfTheTimeBetween) {
  FramePairer pairer(kRateHz);
  auto pairs = Pairs(pairer, Simulate({}, {}, 10));
  const uint64_t before = pairs.back().sequence;
  EXPECT_FALSE(pairer.Add(kTopCamera, {10, 1100 * kMs, 0}));
  pairer.Restart();
  EXPECT_TRUE(pairer.dropped().empty());
  EXPECT_FALSE(pairer.Add(kBottomCamera, {0, 3090 * kMs, 0}));
  const auto pair = pairer.Add(kTopCamera, {0, 3090 * kMs, 0});
  ASSERT_TRUE(pair);
  EXPECT_EQ(pair->sequence - before, 200u);
}

TEST(FramePairer, TimeThatGoesBackStartsAnew) {
  FramePairer pairer(kRateHz);
  const uint64_t before = Pairs(pairer, Simulate({}, {}, 10)).back().sequence;
  EXPECT_FALSE(pairer.Add(kTopCamera, {10, 1100 * kMs, 5}));
  EXPECT_FALSE(pairer.Add(kTopCamera, {11, 50 * kMs, 6}));
  ASSERT_EQ(pairer.dropped().size(), 1u);
  EXPECT_EQ(pairer.dropped()[0].picture.handle, 5);
  const auto pair = pairer.Add(kBottomCamera, {11, 51 * kMs, 0});
  ASSERT_TRUE(pair);
  EXPECT_GT(pair->sequence, before);
}

TEST(FramePairer, WithoutALostCameraEveryPictureIsAFrame) {
  FramePairer pairer(kRateHz);
  const uint64_t before = Pairs(pairer, Simulate({}, {}, 10)).back().sequence;
  EXPECT_FALSE(pairer.Add(kBottomCamera, {10, 1100 * kMs, 3}));
  pairer.Lose(kBottomCamera);
  ASSERT_EQ(pairer.dropped().size(), 1u);
  EXPECT_EQ(pairer.dropped()[0].picture.handle, 3);
  for (uint32_t i = 0; i < 5; ++i) {
    const auto alone = pairer.Add(kTopCamera, {10 + i, (1100 + 10 * i) * kMs, 0});
    ASSERT_TRUE(alone);
    EXPECT_TRUE(alone->has(kTopCamera));
    EXPECT_FALSE(alone->has(kBottomCamera));
    EXPECT_EQ(alone->exposure_ns(), (1100 + 10 * i) * kMs);
    EXPECT_EQ(alone->sequence, before + 1 + i);
  }
  EXPECT_FALSE(pairer.Add(kBottomCamera, {0, 1150 * kMs, 0})) << "it is back, and waits for its partner";
  const auto pair = pairer.Add(kTopCamera, {15, 1150 * kMs, 0});
  ASSERT_TRUE(pair);
  EXPECT_TRUE(pair->is_whole());
  EXPECT_EQ(pair->sequence, before + 6);
}

TEST(FramePairer, TheBottomCameraAloneCountsToo) {
  FramePairer pairer(kRateHz);
  const uint64_t before = Pairs(pairer, Simulate({}, {.first_sequence = 500}, 10)).back().sequence;
  pairer.Lose(kTopCamera);
  EXPECT_EQ(pairer.Add(kBottomCamera, {510, 1100 * kMs, 0})->sequence, before + 1);
  EXPECT_EQ(pairer.Add(kBottomCamera, {513, 1130 * kMs, 0})->sequence, before + 4);
  EXPECT_EQ(pairer.Add(kBottomCamera, {0, 1200 * kMs, 0})->sequence, before + 11) << "counted by time";
}

}  // namespace
}  // namespace taclink

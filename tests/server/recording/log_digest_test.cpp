#include "server/recording/log_digest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sensing/model/model_file.h"

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::NanSensitiveFloatEq;

constexpr int64_t kBegin = 1'700'000'000'000'000'000, kSecond = 1'000'000'000;
const float kNan = std::nanf("");

class LogDigestTest : public ::testing::Test {
 protected:
  void Take(double force_n, int64_t log_utc_ns, bool ring = false) {
    LinkState state;
    state.status = LinkStatus::kOk;
    state.forces.converged = true;
    state.shape.displacements_mm.assign(static_cast<size_t>(model_.markers.count()), Vec3(0, 0, 1));
    state.shape.displacements_mm[0] = Vec3(2, 0, 0);
    state.total_force_n = Vec3(ring ? 0 : force_n, 0, 0);
    Contact& contact = state.contacts.emplace_back();
    contact.is_ring_contact = ring;
    contact.force_n = state.total_force_n;
    contact.normal_force_n = force_n;
    contact.center_mm = Vec3(0, 36, 80);
    digest_.Take("upper", model_, state, log_utc_ns);
  }

  const LinkModel model_ = *LoadLinkModel("cylinder");
  LogDigest digest_;
};

TEST_F(LogDigestTest, WhatIsNotMeasuredIsNoForce) {
  EXPECT_EQ(digest_.Summary().peak_magnitude_n_size(), 0);
  digest_.Take("upper", model_, LinkState(), kBegin);
  Take(0.25, kBegin + 2 * kSecond);
  const v1::LogSummary summary = digest_.Summary();
  EXPECT_THAT(summary.peak_magnitude_n(),
              ElementsAre(NanSensitiveFloatEq(kNan), NanSensitiveFloatEq(kNan), 0.25F));
  EXPECT_EQ(summary.strongest().log_utc_ns(), kBegin + 2 * kSecond);
}

TEST_F(LogDigestTest, ALongLogHasSixtyPartsWithItsPeaks) {
  for (int i = 0; i < 600; ++i) Take(i == 317 ? 9 : 1, kBegin + i * kSecond);
  const v1::LogSummary summary = digest_.Summary();
  ASSERT_EQ(summary.peak_magnitude_n_size(), 60);
  for (int part = 0; part < 60; ++part) EXPECT_EQ(summary.peak_magnitude_n(part), part == 31 ? 9 : 1) << part;
}

TEST_F(LogDigestTest, ARingContactCountsByWhatItPresses) {
  Take(0.3, kBegin);
  EXPECT_NEAR(digest_.Summary().strongest().angle_rad(), kPi / 2, 1e-12);
  Take(2, kBegin + kSecond, true);
  const v1::StrongestContact strongest = digest_.Summary().strongest();
  EXPECT_TRUE(strongest.is_ring_contact());
  EXPECT_EQ(strongest.magnitude_n(), 2);
  EXPECT_FALSE(strongest.has_angle_rad());
  EXPECT_EQ(strongest.displacements()[0], '\xff');
  EXPECT_EQ(strongest.displacements()[1], '\x80');
}

TEST_F(LogDigestTest, AClockThatWasSetLosesNothing) {
  Take(0.3, kBegin);
  Take(0.5, kBegin - 3600 * kSecond);
  Take(0.4, kBegin + int64_t{30} * 24 * 3600 * kSecond);
  EXPECT_EQ(digest_.Summary().peak_magnitude_n(0), 0.5F);
  EXPECT_EQ(digest_.Summary().peak_magnitude_n(59), 0.4F);
  digest_.Clear();
  EXPECT_EQ(digest_.Summary().peak_magnitude_n_size(), 0);
  EXPECT_FALSE(digest_.Summary().has_strongest());
}

}  // namespace
}  // namespace taclink::server

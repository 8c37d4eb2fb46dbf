#include "sensing/pipeline/attitude_check.h"

#include <gtest/gtest.h>

namespace taclink {
namespace {

constexpr int64_t kCheckedEveryNs = 33'000'000, kCheckedFromNs = 1'000'000'000;
constexpr double kMeasuredSigmaMps2 = 0.2;

MeasuredLoads MeasuredAttitude(const Vec3& mps2) {
  MeasuredLoads loads;
  loads.specific_force_mps2 = mps2;
  loads.specific_force_covariance = kMeasuredSigmaMps2 * kMeasuredSigmaMps2 * Mat3::Identity();
  return loads;
}

class AttitudeCheckTest : public ::testing::Test {
 protected:
  // A frame that is estimated with the measurement, which has that error then; or with none, where the skin
  // shows `skin_mps2`. True: it was estimated without.
  bool Show(const Vec3& error_mps2, const Vec3& skin_mps2, bool is_touched) {
    const MeasuredLoads loads = check_.LoadsOf(measured_, now_ns_ += kCheckedEveryNs);
    const bool is_left_out = !(loads.specific_force_mps2 == measured_.specific_force_mps2);
    SkinEstimate estimate;
    if (is_touched) estimate.loads.loads.emplace_back();
    if (!is_left_out) estimate.loads.known_error.tail<3>() = error_mps2;
    estimate.known_loads.specific_force_mps2 = is_left_out ? skin_mps2 : measured_.specific_force_mps2;
    check_.Observe(measured_, baseline_, estimate);
    return is_left_out;
  }

  AttitudeCheck check_;
  const MeasuredLoads measured_ = MeasuredAttitude({0, -9.8, 0}), baseline_ = MeasuredAttitude({0, 0, -9.8});
  const Vec3 elsewhere_mps2_{6, -7.7, 0};
  int64_t now_ns_ = kCheckedFromNs;
};

// A thing that rests on the link must not hide that it is mounted otherwise.
TEST_F(AttitudeCheckTest, ATouchedSkinContradictsAWrongMeasurement) {
  EXPECT_FALSE(Show({1.5, 0, 0}, elsewhere_mps2_, true));
  EXPECT_FALSE(check_.disagreement());
  EXPECT_TRUE(Show(Vec3::Zero(), elsewhere_mps2_, true));
  ASSERT_TRUE(check_.disagreement());
  EXPECT_EQ(check_.disagreement()->skin_mps2, elsewhere_mps2_);
  EXPECT_GT(check_.disagreement()->deviations, AttitudeCheck::kLimit);
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(Show(Vec3::Zero(), elsewhere_mps2_, true)) << "it stays left out";
  EXPECT_TRUE(Show(Vec3::Zero(), measured_.specific_force_mps2, false));
  EXPECT_FALSE(check_.disagreement());
}

// What presses may look like weight to an estimate without the measurement.
TEST_F(AttitudeCheckTest, AContactAloneIsNoContradiction) {
  int tests = 0;
  for (int i = 0; i < 200; ++i) tests += Show({0.1, 0, 0}, elsewhere_mps2_, true) ? 1 : 0;
  EXPECT_GE(tests, 1);
  EXPECT_LE(tests, 3);
  EXPECT_FALSE(check_.disagreement());
}

}  // namespace
}  // namespace taclink

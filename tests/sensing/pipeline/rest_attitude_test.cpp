// Rest images of a slack skin with weight, in several attitudes. Truth: a three-dimensional solid (CalculiX),
// seen by a ray tracer; neither shares anything with the code under test.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "sensing/capture/image_io.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/pipeline/picture_calibration.h"
#include "sensing/pipeline/state_estimator.h"
#include "tests/support/paths.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

/// An attitude: the specific force in it, m/s^2, link frame.
const std::map<std::string, Vec3> kAttitudes = {{"up0", {0, 0, -9.807}},
                                                {"side", {0, -9.807, 0}},
                                                {"tilt", {4.9033, -6.9343, -4.9033}},
                                                {"sidepress", {0, -9.807, 0}}};

std::string ImagePath(const std::string& state, CameraId id) {
  return testing::TestData("gravity/" + state + "_" + Name(id) + ".png");
}

RestPictures Images(const std::string& state) {
  RestPictures images;
  for (const CameraId id : kBothCameras) images[Index(id)] = ReadGrayImage(ImagePath(state, id)).value();
  return images;
}

MeasuredLoads Known(const std::string& state) {
  MeasuredLoads loads;
  loads.specific_force_mps2 = kAttitudes.at(state);
  loads.specific_force_covariance = 0.04 * Mat3::Identity();
  return loads;
}

MeasuredLoads Unknown() {
  MeasuredLoads loads;
  loads.ForgetAttitude();
  return loads;
}

double DegreesBetween(const Vec3& a, const Vec3& b) {
  return DegFromRad(std::atan2(a.cross(b).norm(), a.dot(b)));
}

struct RestCase {
  std::string state;
  bool is_known;
};

class RestAttitudeTest : public ::testing::TestWithParam<RestCase> {
 protected:
  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const std::unique_ptr<StateEstimator> estimator_ = MakeStateEstimator(model_, {});
};

TEST_P(RestAttitudeTest, CamerasShapeAndAttitudeAreFound) {
  const auto& [state, is_known] = GetParam();
  const RestPictures images = Images(state);
  const RestConditions rest{.loads = is_known ? Known(state) : Unknown(), .skin = estimator_->AtRest()};
  const auto found = CalibrateFromPictures(model_, {&images, 1}, rest);
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_LT(found->calibration.rmse_3d_mm, 0.1);
  EXPECT_GE(found->calibration.markers_used, 0.9 * model_.markers.count());
  // A wrong label lies a ring or a path away, 9 mm at least.
  for (const auto& shift : found->calibration.shifts_mm) EXPECT_LT(shift.value_or(Vec3::Zero()).norm(), 1);
  EXPECT_LT(DegreesBetween(found->loads.specific_force_mps2, kAttitudes.at(state)), is_known ? 1.5 : 4);
  // Cameras that are nominal to the ray tracer.
  for (const CameraId id : kBothCameras) {
    const CameraStep off = StepBetween(model_.nominal_rig[id], found->calibration.rig[id]);
    EXPECT_LT(DegFromRad(off.head<3>().norm()), 0.25) << Name(id);
    EXPECT_LT(off.segment<2>(3).norm(), 0.1) << Name(id);
  }
}

INSTANTIATE_TEST_SUITE_P(Attitudes, RestAttitudeTest,
                         ::testing::Values(RestCase{"up0", true}, RestCase{"up0", false},
                                           RestCase{"side", true}, RestCase{"side", false},
                                           RestCase{"tilt", true}, RestCase{"tilt", false}),
                         [](const auto& one) {
                           return one.param.state + (one.param.is_known ? "Known" : "Unknown");
                         });

class TurnedLinkTest : public ::testing::Test {
 protected:
  StereoFrame Frame(const std::string& state) {
    StereoFrame frame;
    for (const CameraId id : kBothCameras)
      EXPECT_TRUE(ReadRawImage(ImagePath(state, id), frame.images[Index(id)]).ok());
    frame.sequence = frames_++;
    return frame;
  }
  StereoFrame FrameAt(const std::string& state, const MeasuredLoads& loads) {
    StereoFrame frame = Frame(state);
    frame.specific_force = {loads.specific_force_mps2, loads.specific_force_covariance};
    return frame;
  }
  PipelineOptions Options() const {
    PipelineOptions options;
    options.pressure_mpa = 0;
    options.rest_frames = 1;
    options.pictures_may_repeat = true;
    return options;
  }
  void ExpectPress() const {
    EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
    ASSERT_EQ(state_.contacts.size(), 1U);
    EXPECT_NEAR(state_.contacts[0].normal_force_n, 0.0433, 0.004);
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  uint64_t frames_ = 0;
  LinkState state_;
};

TEST_F(TurnedLinkTest, ABaselineHoldsInOtherAttitudes) {
  LinkPipeline pipeline(model_, Options());
  pipeline.Process(FrameAt("up0", Known("up0")), state_);
  ASSERT_TRUE(pipeline.calibration()) << state_.status_reason;
  for (const std::string untouched : {"side", "tilt", "up0"}) {
    pipeline.Process(FrameAt(untouched, Known(untouched)), state_);
    EXPECT_EQ(state_.status, LinkStatus::kOk) << untouched << ": " << state_.status_reason;
    EXPECT_TRUE(state_.contacts.empty()) << untouched;
  }
  pipeline.Process(FrameAt("sidepress", Known("side")), state_);
  ExpectPress();
  pipeline.Process(FrameAt("tilt", Unknown()), state_);
  EXPECT_TRUE(state_.contacts.empty());
  ASSERT_TRUE(state_.specific_force_estimate);
  EXPECT_LT(DegreesBetween(state_.specific_force_estimate->mps2, kAttitudes.at("tilt")), 5);
}

TEST_F(TurnedLinkTest, ALinkThatNeverMovesMayBeMountedInAnyAttitude) {
  LinkPipeline pipeline(model_, Options());
  // With each refusal another attitude is tried.
  int pairs = 0;
  for (; pairs < 20 && !pipeline.calibration(); ++pairs) pipeline.Process(Frame("side"), state_);
  ASSERT_TRUE(pipeline.calibration()) << state_.status_reason;
  EXPECT_GT(pairs, 1);
  pipeline.Process(Frame("side"), state_);
  EXPECT_TRUE(state_.contacts.empty());
  EXPECT_FALSE(state_.specific_force_estimate) << "what never changes cannot be told";
  pipeline.Process(Frame("sidepress"), state_);
  ExpectPress();
}

TEST_F(TurnedLinkTest, KnownCamerasNeedNoAttitude) {
  PipelineOptions options = Options();
  options.rig = model_.nominal_rig;
  LinkPipeline pipeline(model_, options);
  pipeline.Process(FrameAt("tilt", Unknown()), state_);
  ASSERT_TRUE(pipeline.calibration()) << state_.status_reason;
  pipeline.Process(FrameAt("side", Known("side")), state_);
  EXPECT_TRUE(state_.contacts.empty());
  pipeline.Process(FrameAt("sidepress", Known("side")), state_);
  ExpectPress();
}

// The baseline is taken upright; then the link is turned, and the mounting is told wrong by an angle about x.
class MountTest : public TurnedLinkTest {
 protected:
  static MeasuredLoads Told(const std::string& state, double wrong_deg) {
    MeasuredLoads loads = Known(state);
    const Eigen::AngleAxisd turn(RadFromDeg(wrong_deg), Vec3::UnitX());
    loads.specific_force_mps2 = turn * loads.specific_force_mps2;
    return loads;
  }
  StereoFrame FrameAfter(double seconds, const std::string& state, double wrong_deg) {
    StereoFrame frame = FrameAt(state, Told(state, wrong_deg));
    frame.times.exposure_monotonic_ns = 1'000'000'000 + std::llround(1e9 * seconds);
    return frame;
  }
  bool HasMismatch() const {
    return std::ranges::any_of(state_.reasons,
                               [](const Reason& one) { return one.id == ReasonId::kAttitudeMismatch; });
  }
};

class WrongMountTest : public MountTest, public ::testing::WithParamInterface<double> {};

TEST_P(WrongMountTest, IsFoundOnceTheLinkHasTurned) {
  const double wrong_deg = GetParam();
  LinkPipeline pipeline(model_, Options());
  double seconds = 0;
  for (int pairs = 0; pairs < 20 && !pipeline.calibration(); ++pairs)
    pipeline.Process(FrameAfter(++seconds, "up0", wrong_deg), state_);
  ASSERT_TRUE(pipeline.calibration()) << state_.status_reason;
  bool is_found = false;
  for (const std::string state : {"up0", "side", "side", "tilt", "tilt"}) {
    seconds += 2;
    pipeline.Process(FrameAfter(seconds, state, wrong_deg), state_);
    is_found = is_found || HasMismatch();
  }
  EXPECT_TRUE(is_found);
  if (!HasMismatch()) return;
  // What is contradicted is not used: forces are right.
  EXPECT_TRUE(state_.contacts.empty());
  pipeline.Process(FrameAfter(seconds + 0.03, "sidepress", wrong_deg), state_);
  ASSERT_EQ(state_.contacts.size(), 1U);
  EXPECT_NEAR(state_.contacts[0].normal_force_n, 0.0433, 0.006);
}

INSTANTIATE_TEST_SUITE_P(Degrees, WrongMountTest, ::testing::Values(20.0, -20.0, 90.0));

TEST_F(MountTest, ARightOneIsNotDoubted) {
  LinkPipeline pipeline(model_, Options());
  double seconds = 0;
  for (const std::string state : {"up0", "up0", "side", "tilt", "side", "up0"}) {
    pipeline.Process(FrameAfter(seconds += 4, state, 0), state_);
    EXPECT_FALSE(HasMismatch()) << state << ": " << state_.status_reason;
  }
}

TEST_F(TurnedLinkTest, ATouchedSkinIsNoAttitude) {
  LinkPipeline pipeline(model_, Options());
  for (int pairs = 0; pairs < 6; ++pairs) {
    pipeline.Process(FrameAt("sidepress", Known("side")), state_);
    ASSERT_FALSE(pipeline.calibration()) << pairs;
    EXPECT_THAT(state_.status_reason, HasSubstr("touched"));
  }
}

}  // namespace
}  // namespace taclink

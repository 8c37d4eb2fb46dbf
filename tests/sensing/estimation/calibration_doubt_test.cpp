// Against cameras that are really moved: what the calibrated ones make of a displacement then.
#include "sensing/estimation/calibration_doubt.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "sensing/camera/projection.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr int kBoth = kCameraParameters * kCameraCount;
enum : int { kTopZ = 5, kBottomFocal = kCameraParameters + 8 };

class CalibrationDoubtTest : public ::testing::TestWithParam<const char*> {
 protected:
  // Least squares over both cameras, as they are calibrated, of what the real ones show.
  Vec3 Seen(const StereoRig& real, const Vec3& rest, const Vec3& u) const {
    Mat3 information = Mat3::Zero();
    Vec3 pull = Vec3::Zero();
    for (const CameraId id : kBothCameras) {
      const Projector sees(real[id]), believed(model_.nominal_rig[id]);
      const auto at_rest = believed.ProjectWithJacobian(rest);
      const Vec2 moved = *sees.Project(rest + u) - *sees.Project(rest);
      const Vec2 expected = *believed.Project(rest + u) - at_rest->pixel;
      information += at_rest->jacobian.transpose() * at_rest->jacobian;
      pull += at_rest->jacobian.transpose() * (moved - expected);
    }
    return information.ldlt().solve(pull);
  }
  StereoRig WithStep(int parameter, double size) const {
    StereoRig rig = model_.nominal_rig;
    CameraStep step = CameraStep::Zero();
    step[parameter % kCameraParameters] = size;
    CameraModel& camera = rig.cameras[static_cast<size_t>(parameter / kCameraParameters)];
    camera = Moved(camera, step);
    return rig;
  }

  const LinkModel model_ = *LoadLinkModel(GetParam());
};

TEST_P(CalibrationDoubtTest, IsWhatWrongCamerasMakeOfADisplacement) {
  for (const auto& [parameter, sigma] : {std::pair(int{kTopZ}, 0.5), std::pair(int{kBottomFocal}, 0.5)}) {
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(kBoth, kBoth);
    covariance(parameter, parameter) = sigma * sigma;
    const CalibrationDoubt doubt(model_, model_.nominal_rig, covariance);
    const StereoRig real = WithStep(parameter, sigma);
    double told2 = 0, error2 = 0;
    for (int marker = 0; marker < model_.markers.count(); ++marker) {
      const Vec3 rest = model_.RestMarker(marker);
      const Vec3 out = Vec3(rest.x(), rest.y(), 0).normalized();
      for (const Vec3& u : {Vec3(0.5 * out), Vec3(-0.5 * out)}) {
        const Vec3 error = Seen(real, rest, u);
        const Vec3 along = error.normalized();
        told2 += along.dot(doubt.Of(static_cast<size_t>(marker), u) * along);
        error2 += error.squaredNorm();
      }
    }
    // Less by what is left to the skin's mechanics along the direction that the cameras tell worst.
    EXPECT_GT(std::sqrt(told2 / error2), 0.75) << "parameter " << parameter;
    EXPECT_LT(std::sqrt(told2 / error2), 1.02) << "parameter " << parameter;
  }
}

TEST_P(CalibrationDoubtTest, GrowsWithTheDisplacementOnly) {
  const Eigen::MatrixXd covariance = 1e-4 * Eigen::MatrixXd::Identity(kBoth, kBoth);
  const CalibrationDoubt doubt(model_, model_.nominal_rig, covariance);
  EXPECT_EQ(doubt.Of(17, Vec3::Zero()), Mat3(Mat3::Zero()));
  const Vec3 u(1, -2, 0.5);
  ASSERT_GT(doubt.Of(17, u).trace(), 0);
  EXPECT_NEAR(doubt.Of(17, 3 * u).trace() / doubt.Of(17, u).trace(), 9, 1e-9);
}

TEST_P(CalibrationDoubtTest, WithoutACovarianceThereIsNone) {
  const CalibrationDoubt doubt(model_, model_.nominal_rig, {});
  EXPECT_EQ(doubt.Of(17, Vec3(5, 5, 5)), Mat3(Mat3::Zero()));
}

INSTANTIATE_TEST_SUITE_P(Models, CalibrationDoubtTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink

#include "sensing/camera/bundle.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "sensing/camera/lens.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

/// A link as it might be built within the tolerances, and its rest pictures.
struct BuiltLink {
  StereoRig rig;
  std::vector<BundleCamera> pictures;
};

constexpr double kNoisePx = 0.2;

CameraModel Built(const CameraModel& nominal, const BuildTolerance& tolerance, LensKind kind,
                  std::mt19937& random) {
  std::normal_distribution<double> normal;
  CameraModel camera = nominal;
  camera.lens = ConvertLens(nominal.lens, kind, 0.9);
  CameraStep step = CameraStep::Zero();
  for (int i = 0; i < 8; ++i) step[i] = normal(random);
  step.head<2>() *= tolerance.tilt_rad;
  step[2] *= tolerance.roll_rad;
  step.segment<3>(3) *= tolerance.place_mm;
  step.segment<2>(6) *= tolerance.principal_point_px;
  step[8] = 0.5 * tolerance.lens * camera.lens.focal_px * normal(random);
  return Moved(camera, step);
}

BuiltLink Build(const LinkModel& model, const BuildTolerance& tolerance, LensKind kind,
                std::mt19937& random) {
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) { return sigma * normal(random); };
  std::vector<Vec3> markers = model.RestMarkers();
  for (Vec3& p : markers) {
    for (double& x : p) x += noise(tolerance.marker_mm);
  }
  BuiltLink link;
  for (const CameraId id : kBothCameras) {
    link.rig[id] = Built(model.nominal_rig[id], tolerance, kind, random);
    const Projector projector(link.rig[id]);
    BundleCamera camera{model.nominal_rig[id], model.nominal_rig[id], {}};
    camera.start.lens = ConvertLens(camera.start.lens, kind, 0.9);
    for (int m = 0; m < model.markers.count(); ++m) {
      const Vec2 pixel = *projector.Project(markers[static_cast<size_t>(m)]);
      camera.samples.push_back({m, model.RestMarker(m), pixel + Vec2(noise(kNoisePx), noise(kNoisePx)),
                                kNoisePx * kNoisePx * Mat2::Identity()});
    }
    link.pictures.push_back(camera);
  }
  return link;
}

class BundleTest : public ::testing::TestWithParam<LensKind> {};

// The errors' squares over the stated covariance: 1 per parameter if that is right.
TEST_P(BundleTest, CovarianceIsThatOfTheErrors) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  std::mt19937 random(4);
  constexpr int kTrials = 40;
  const int parameters = CameraParameterCount(GetParam());
  double sum = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const BuiltLink link = Build(model, {}, GetParam(), random);
    const BundleResult found = AdjustBundle(link.pictures, {});
    ASSERT_TRUE(found.converged);
    ASSERT_EQ(found.covariance.rows(), 2 * kCameraParameters);
    for (const CameraId id : kBothCameras) {
      const auto first = static_cast<Eigen::Index>(Index(id)) * kCameraParameters;
      const Eigen::MatrixXd covariance = found.covariance.block(first, first, parameters, parameters);
      const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
      const Eigen::VectorXd off =
          scale.cwiseProduct(StepBetween(link.rig[id], found.cameras[Index(id)]).head(parameters));
      sum += off.dot((scale.asDiagonal() * covariance * scale.asDiagonal()).ldlt().solve(off));
    }
  }
  const double per_parameter = sum / (2 * kTrials * parameters);
  EXPECT_GT(per_parameter, 0.7);
  EXPECT_LT(per_parameter, 1.4);
}

TEST_P(BundleTest, OutliersHardlyPull) {
  const LinkModel model = LoadLinkModel("barrel").value();
  std::mt19937 random(5);
  BuiltLink link = Build(model, {}, GetParam(), random);
  const BundleResult clean = AdjustBundle(link.pictures, {});
  for (auto& picture : link.pictures) {
    for (size_t i = 3; i < picture.samples.size(); i += 25) picture.samples[i].pixel += Vec2(9, -7);
  }
  const BundleResult soiled = AdjustBundle(link.pictures, {});
  for (const CameraId id : kBothCameras) {
    const CameraStep sigmas =
        clean.covariance.diagonal()
            .segment<kCameraParameters>(static_cast<Eigen::Index>(Index(id)) * kCameraParameters)
            .cwiseSqrt();
    const CameraStep step = StepBetween(clean.cameras[Index(id)], soiled.cameras[Index(id)]);
    for (int i = 0; i < 8; ++i) EXPECT_LT(std::abs(step[i]), 1.5 * sigmas[i]) << "parameter " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, BundleTest, ::testing::Values(LensKind::kDivision, LensKind::kKannalaBrandt),
                         [](const auto& one) { return std::string(Name(one.param)); });

TEST(Bundle, CameraThatCannotSeeItsSamplesDoesNotConverge) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const CameraModel& camera = model.nominal_rig[CameraId::kTop];
  const BundleCamera blind{camera, camera, {{0, Vec3(10, 0, -300), Vec2(100, 100), Mat2::Identity()}}};
  EXPECT_FALSE(AdjustBundle({&blind, 1}, {}).converged);
}

}  // namespace
}  // namespace taclink

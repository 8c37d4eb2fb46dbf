#include "sensing/shape/reconstructor.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "sensing/model/model_file.h"
#include "tests/support/synthetic_markers.h"

namespace taclink {
namespace {

/// Labels without error: what a perfect tracker would hand on.
LabelledMarkers TrueLabels(const LinkModel& model, const std::vector<Dent>& dents, double noise_px,
                           std::mt19937& random) {
  std::normal_distribution<double> gauss(0, noise_px);
  LabelledMarkers labels;
  for (const CameraId id : kBothCameras) {
    const Projector projector(model.nominal_rig[id]);
    for (int i = 0; i < model.markers.count(); ++i) {
      const auto pixel = projector.Project(Deform(model, dents, model.RestMarker(i)));
      labels.cameras[Index(id)].push_back(
          {pixel.has_value(), pixel ? Vec2(*pixel + Vec2(gauss(random), gauss(random))) : Vec2(Vec2::Zero()),
           Mat2(noise_px * noise_px * Mat2::Identity())});
    }
  }
  return labels;
}

class ReconstructorTest : public testing::TestWithParam<std::string> {
 protected:
  size_t count() const { return static_cast<size_t>(model_.markers.count()); }
  Vec3 Truth(size_t i) const { return Deform(model_, dents_, model_.RestMarker(static_cast<int>(i))); }

  LinkModel model_ = LoadLinkModel(GetParam()).value();
  std::vector<Dent> dents_ = {{1.0, 0.45 * model_.length_mm, 8, 25}};
  std::mt19937 random_{4};
  SkinShape shape_;
};

TEST_P(ReconstructorTest, TriangulatesWithAnHonestCovariance) {
  ShapeReconstructor reconstructor(model_, model_.nominal_rig, {.camera_sigma_px = 0});
  double squares = 0, normalised = 0;
  int n = 0;
  for (int trial = 0; trial < 20; ++trial) {
    reconstructor.Reconstruct(TrueLabels(model_, dents_, 0.1, random_), shape_);
    for (size_t i = 0; i < count(); ++i) {
      ASSERT_EQ(shape_.sources[i], MarkerSource::kBoth);
      const Vec3 error = shape_.positions_mm[i] - Truth(i);
      squares += error.squaredNorm();
      normalised += error.dot(shape_.covariances_mm2[i].ldlt().solve(error));
      ++n;
    }
  }
  EXPECT_LT(std::sqrt(squares / n), 0.15);
  EXPECT_NEAR(normalised / n, 3, 0.15);  // chi-square of three degrees of freedom
}

TEST_P(ReconstructorTest, DisplacementsAreFromTheMeasuredBaseline) {
  ShapeReconstructor reconstructor(model_, model_.nominal_rig, {.camera_sigma_px = 0});
  reconstructor.Reconstruct(TrueLabels(model_, {}, 0.05, random_), shape_);
  const SkinShape rest = shape_;
  reconstructor.SetBaseline(rest);
  reconstructor.Reconstruct(TrueLabels(model_, dents_, 0.05, random_), shape_);
  double normalised = 0;
  for (size_t i = 0; i < count(); ++i) {
    EXPECT_LT((shape_.displacements_mm[i] - (shape_.positions_mm[i] - rest.positions_mm[i])).norm(), 1e-9);
    const Vec3 error = shape_.displacements_mm[i] - (Truth(i) - model_.RestMarker(static_cast<int>(i)));
    normalised += error.dot(shape_.covariances_mm2[i].ldlt().solve(error));
  }
  EXPECT_NEAR(normalised / static_cast<double>(count()), 3, 0.6);
  // Taking the baseline again from a shape measured against it counts its noise once.
  reconstructor.SetBaseline(shape_);
  SkinShape again;
  reconstructor.Reconstruct(TrueLabels(model_, dents_, 0.05, random_), again);
  EXPECT_NEAR(again.covariances_mm2[5].trace() / shape_.covariances_mm2[5].trace(), 1, 0.1);
}

TEST_P(ReconstructorTest, OneCameraAssumesTheRestZAndSaysSo) {
  ShapeReconstructor reconstructor(model_, model_.nominal_rig);
  LabelledMarkers labels = TrueLabels(model_, {}, 0.1, random_);
  const auto one = static_cast<size_t>(model_.MarkerIndex(2, 2)),
             other = static_cast<size_t>(model_.MarkerIndex(3, 5));
  labels.cameras[1][one].seen = false;
  labels.cameras[0][other].seen = false;
  reconstructor.Reconstruct(labels, shape_);
  EXPECT_EQ(shape_.sources[one], MarkerSource::kTop);
  EXPECT_EQ(shape_.sources[other], MarkerSource::kBottom);
  for (const size_t i : {one, other}) {
    const Vec3 rest_error = shape_.positions_mm[i] - model_.RestMarker(static_cast<int>(i));
    EXPECT_LT(rest_error.norm(), 1);
    EXPECT_NEAR(std::sqrt(shape_.covariances_mm2[i](2, 2)), 2.5, 0.01);
  }
}

TEST_P(ReconstructorTest, UnseenMarkersFollowTheirPath) {
  ShapeReconstructor reconstructor(model_, model_.nominal_rig);
  LabelledMarkers labels = TrueLabels(model_, {}, 0, random_);
  for (auto& camera : labels.cameras) {
    for (int ring = 0; ring < model_.markers.rings(); ++ring) {
      // A whole path gone, and a hole in another.
      camera[static_cast<size_t>(model_.MarkerIndex(1, ring))].seen = false;
      if (ring == 3 || ring == 4) camera[static_cast<size_t>(model_.MarkerIndex(4, ring))].seen = false;
    }
  }
  reconstructor.Reconstruct(labels, shape_);
  EXPECT_EQ(shape_.CountOf(MarkerSource::kInferred), model_.markers.rings() + 2);
  for (size_t i = 0; i < count(); ++i) {
    if (shape_.sources[i] != MarkerSource::kInferred) continue;
    EXPECT_LT((shape_.positions_mm[i] - model_.RestMarker(static_cast<int>(i))).norm(), 1e-3);
    EXPECT_GE(shape_.covariances_mm2[i](0, 0), 16);
  }
}

TEST_P(ReconstructorTest, ImplausiblePairsCountAsUnseen) {
  ShapeReconstructor reconstructor(model_, model_.nominal_rig);
  LabelledMarkers labels = TrueLabels(model_, {}, 0.1, random_);
  const auto marker = static_cast<size_t>(model_.MarkerIndex(0, 4));
  labels.cameras[0][marker].center_px += Vec2(0, 25);  // across the path: the rays miss each other
  const auto far = static_cast<size_t>(model_.MarkerIndex(6, 4));
  for (auto& camera : labels.cameras) camera[far].center_px = Vec2(std::nan(""), 3);
  reconstructor.Reconstruct(labels, shape_);
  EXPECT_EQ(shape_.sources[marker], MarkerSource::kInferred);
  EXPECT_EQ(shape_.sources[far], MarkerSource::kInferred);
  for (const Vec3& p : shape_.positions_mm) EXPECT_TRUE(p.allFinite());
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, ReconstructorTest, testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink

#include "sensing/simulation/renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <opencv2/imgproc.hpp>

#include "sensing/simulation/occlusion.h"
#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

CameraEffects Quiet() {
  CameraEffects effects;
  effects.sensor_noise_levels = 0;
  return effects;
}

// Moves all markers but one out of every camera's sight.
SkinTruth Alone(SkinTruth truth, int marker) {
  for (size_t i = 0; i < truth.marker_wall_mm.size(); ++i) {
    if (static_cast<int>(i) != marker) truth.marker_wall_mm[i] = Vec3(0, 1e6, 0);
  }
  return truth;
}

struct Blob {
  double weight = 0;
  Vec2 center = Vec2::Zero();
  bool clipped = false;
};

Blob Difference(const cv::Mat& with, const cv::Mat& without) {
  Blob blob;
  for (int y = 0; y < with.rows; ++y) {
    for (int x = 0; x < with.cols; ++x) {
      const int d = with.at<uint8_t>(y, x) - without.at<uint8_t>(y, x);
      if (d <= 0) continue;
      blob.weight += d;
      blob.center += d * Vec2(x, y);
      blob.clipped = blob.clipped || x == 0 || y == 0 || x == with.cols - 1 || y == with.rows - 1;
    }
  }
  if (blob.weight > 0) blob.center /= blob.weight;
  return blob;
}

class RendererTest : public ::testing::TestWithParam<std::string> {
 protected:
  cv::Mat Picture(Renderer& renderer, const SkinTruth& truth, CameraId id) const {
    cv::Mat gray;
    renderer.Render(truth, id, gray);
    return gray;
  }
  LinkModel model_ = Model(GetParam());
  SkinTruth rest_ = TruthAt(model_, SceneWith(""), 0);
};

// Centroid of half a ball's silhouette: a half disc above half an ellipse as high as the base looks.
Vec3 SilhouetteCentroid(const SkinTruth& truth, int marker, double radius_mm, const Vec3& camera_mm) {
  const auto m = static_cast<size_t>(marker);
  const Vec3 to_camera = (camera_mm - truth.marker_wall_mm[m]).normalized();
  const double facing = -truth.marker_normal[m].dot(to_camera);
  const Vec3 up = (-truth.marker_normal[m] - facing * to_camera).normalized();
  return truth.marker_wall_mm[m] + 4 * radius_mm / (3 * kPi) * (1 - facing) * up;
}

TEST_P(RendererTest, MarkersAreWhereTheirCentresProject) {
  Renderer renderer(model_, model_.nominal_rig, Quiet(), 1);
  const double radius_mm = model_.markers.diameter_mm / 2;
  for (const CameraId id : kBothCameras) {
    const Projector camera(model_.nominal_rig[id]);
    const cv::Mat empty = Picture(renderer, Alone(rest_, -1), id);
    double sum_far = 0, worst_far = 0, worst = 0, worst_shape = 0;
    int far = 0, drawn = 0;
    for (int m = 0; m < model_.markers.count(); ++m) {
      const Blob blob = Difference(Picture(renderer, Alone(rest_, m), id), empty);
      if (blob.weight == 0 || blob.clipped) continue;
      ++drawn;
      const Vec2 outline = *camera.Project(SilhouetteCentroid(rest_, m, radius_mm, camera.center_in_link()));
      const double radius_px =
          radius_mm *
          camera.ProjectWithJacobian(rest_.marker_wall_mm[static_cast<size_t>(m)])->jacobian.norm();
      worst_shape = std::max(worst_shape, (blob.center - outline).norm());
      EXPECT_LT((blob.center - outline).norm(), 0.2 + 0.03 * radius_px) << Name(id) << " " << m;
      // The model's centre is where a marker seen from the side has its centroid; a near one shows more of
      // its top.
      const double off = (blob.center - *camera.Project(rest_.marker_mm[static_cast<size_t>(m)])).norm();
      worst = std::max(worst, off);
      const int ring = model_.RingOf(m), rings = model_.markers.rings();
      if ((id == CameraId::kTop ? ring : rings - 1 - ring) < rings * 3 / 4) continue;
      ++far;
      sum_far += off;
      worst_far = std::max(worst_far, off);
    }
    std::cout << GetParam() << " " << Name(id) << ", centroid against the centre's projection: far quarter "
              << sum_far / far << " px on average, " << worst_far << " at most; all " << drawn << " " << worst
              << " at most; against the silhouette " << worst_shape << " at most\n";
    EXPECT_GT(drawn, model_.markers.count() * 95 / 100);
    EXPECT_LT(worst_far, 0.6);
    EXPECT_LT(worst, 3.5);
  }
}

// Whatever was drawn before: a dent that comes and goes, hides markers and shows them again.
TEST_P(RendererTest, DrawsAgainWhatHasChangedAndNothingElse) {
  Renderer renderer(model_, model_.nominal_rig, CameraEffects(), 1);
  const Scene scene = SceneWith(
      "contacts:\n  - {at: {path: 3, ring: 4}, force_n: 0.5, begin_s: 0.5, end_s: 2.5, ramp_s: 0.5}\n");
  for (const double s : {0.0, 0.0, 0.4, 0.9, 0.9, 1.0, 1.7, 3.0, 0.9}) {
    const SkinTruth truth = TruthAt(model_, scene, s);
    for (const CameraId id : kBothCameras) {
      Renderer fresh(model_, model_.nominal_rig, CameraEffects(), 1);
      EXPECT_EQ(cv::norm(Picture(renderer, truth, id), Picture(fresh, truth, id), cv::NORM_INF), 0) << s;
    }
  }
}

TEST_P(RendererTest, ZeroLoadLooksLikeRestButForNoise) {
  Renderer noisy(model_, model_.nominal_rig, CameraEffects(), 1);
  const SkinTruth later = TruthAt(model_, SceneWith("pressure_kpa: 0\n"), 1);
  const cv::Mat a = Picture(noisy, rest_, CameraId::kTop), b = Picture(noisy, later, CameraId::kTop);
  cv::Mat difference, mean, deviation;
  cv::subtract(a, b, difference, cv::noArray(), CV_32F);
  cv::meanStdDev(difference, mean, deviation);
  EXPECT_NEAR(mean.at<double>(0), 0, 0.05);
  EXPECT_NEAR(deviation.at<double>(0), 2 * std::sqrt(2.0), 0.3);
}

TEST_P(RendererTest, SameSeedSameBytes) {
  CameraEffects effects;
  effects.marker_jitter_px = 0.3;
  Renderer one(model_, model_.nominal_rig, effects, 5), same(model_, model_.nominal_rig, effects, 5);
  Renderer other(model_, model_.nominal_rig, effects, 6);
  SkinTruth next = rest_;
  next.frame = rest_.frame + 1;
  const auto differ = [](const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) > 0; };
  for (const CameraId id : kBothCameras) {
    const cv::Mat picture = Picture(one, rest_, id);
    EXPECT_FALSE(differ(picture, Picture(same, rest_, id)));
    EXPECT_TRUE(differ(picture, Picture(other, rest_, id)));
    EXPECT_TRUE(differ(picture, Picture(one, next, id)));
  }
}

TEST_P(RendererTest, JitterShiftsEachMarker) {
  CameraEffects effects = Quiet();
  effects.marker_jitter_px = 0.3;
  Renderer steady(model_, model_.nominal_rig, Quiet(), 1), shaky(model_, model_.nominal_rig, effects, 1);
  const cv::Mat empty = Picture(steady, Alone(rest_, -1), CameraId::kTop);
  double sum = 0;
  int count = 0;
  for (int m = 0; m < model_.markers.count() / 2; ++m) {
    const SkinTruth alone = Alone(rest_, m);
    const Blob a = Difference(Picture(steady, alone, CameraId::kTop), empty);
    const Blob b = Difference(Picture(shaky, alone, CameraId::kTop), empty);
    if (a.clipped || b.clipped || a.weight == 0) continue;
    sum += (a.center - b.center).squaredNorm() / 2;
    ++count;
  }
  EXPECT_NEAR(std::sqrt(sum / count), 0.3, 0.06);
}

TEST_P(RendererTest, ADeepDentHidesMarkersBehindIt) {
  Renderer renderer(model_, model_.nominal_rig, Quiet(), 1);
  const std::string depth =
      GetParam() == "barrel" ? "28" : "15";  // the barrel's ends hide its bulge until then
  const Scene scene = SceneWith("contacts:\n  - {at: {path: 3, ring: 5}, depth_mm: " + depth +
                                ", patch_diameter_mm: 12, begin_s: 0, end_s: 4}\n");
  const SkinTruth dent = TruthAt(model_, scene, 2);
  for (const CameraId id : kBothCameras) {
    int hidden = 0;
    for (int m = 0; m < model_.markers.count(); ++m) {
      EXPECT_TRUE(renderer.Sees(rest_, id, m));
      if (renderer.Sees(dent, id, m)) continue;
      ++hidden;
      // Only beyond the dent and near its path.
      const bool beyond = id == CameraId::kTop ? model_.RingOf(m) > 3 : model_.RingOf(m) < 5;
      EXPECT_TRUE(beyond) << m;
      EXPECT_LE(std::abs(model_.PathOf(m) - 2), 4) << m;
    }
    EXPECT_GT(hidden, 0);
    EXPECT_LT(hidden, model_.markers.count() / 6);
  }
}

TEST_P(RendererTest, LooksLikeARealPicture) {
  Renderer renderer(model_, model_.nominal_rig, Quiet(), 1);
  for (const CameraId id : kBothCameras) {
    const cv::Mat picture = Picture(renderer, rest_, id);
    EXPECT_EQ(picture.cols, 640);
    EXPECT_EQ(picture.rows, 480);
    const Projector camera(model_.nominal_rig[id]);
    const auto at = [&](const Vec3& p) {
      const Vec2 pixel = *camera.Project(p);
      return static_cast<int>(picture.at<uint8_t>(cvRound(pixel.y()), cvRound(pixel.x())));
    };
    const int rings = model_.markers.rings();
    const bool top = id == CameraId::kTop;
    const int near_level = at(model_.RestMarker(model_.MarkerIndex(0, top ? 1 : rings - 2)));
    const int far_level = at(model_.RestMarker(model_.MarkerIndex(0, top ? rings - 1 : 0)));
    EXPECT_GT(near_level, 150);
    EXPECT_GT(far_level, 60);
    EXPECT_GT(near_level, far_level + 30);
    EXPECT_LT(at({0, 0, model_.length_mm / 2}), 40);  // the far camera's housing
    EXPECT_LT(picture.at<uint8_t>(2, 2), 40);         // outside the skin
  }
}

TEST(PackYuyv, InterleavesBrightnessAndColour) {
  const cv::Mat gray = (cv::Mat_<uint8_t>(1, 4) << 10, 20, 30, 40);
  const cv::Mat chroma = (cv::Mat_<uint8_t>(1, 4) << 1, 2, 3, 4);
  RawImage image;
  PackYuyv(gray, chroma, image);
  EXPECT_EQ(image.format, PixelFormat::kYuyv);
  EXPECT_EQ(image.bytes, (std::vector<uint8_t>{10, 1, 20, 2, 30, 3, 40, 4}));
  PackYuyv(gray, cv::Mat(), image);
  EXPECT_EQ(image.bytes, (std::vector<uint8_t>{10, 128, 20, 128, 30, 128, 40, 128}));
  EXPECT_TRUE(image.valid);
}

TEST(Occlusion, ARidgeHidesWhatLiesBehindIt) {
  RadiusGrid wall;
  wall.columns = 8;
  wall.z_mm = {0, 50, 100};
  wall.radius_mm.assign(24, 30);
  wall.radius_mm[8] = 10;  // at angle 0, z = 50
  wall.row_min_mm = {30, 10, 30};
  EXPECT_TRUE(IsHidden(wall, {29, 0, 90}, {0, 0, -10}, 0.1));
  EXPECT_FALSE(IsHidden(wall, {-29, 0, 90}, {0, 0, -10}, 0.1));
  EXPECT_FALSE(IsHidden(wall, {29, 0, 40}, {0, 0, -10}, 0.1));  // before the ridge
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, RendererTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink

// What cameras see, against rendered images and against rays cast by other means.
#include "sensing/design/visibility.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "sensing/camera/projection.h"
#include "sensing/simulation/renderer.h"
#include "tests/sensing/design/design_models.h"
#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

// A marker that is drawn alone, as the pixels that it brightens.
struct Spot {
  double weight = 0;  // of pixels, as shares of the brightest
  cv::Rect box;
};

Spot SpotOf(const cv::Mat& with, const cv::Mat& without) {
  cv::Mat difference, bright;
  cv::subtract(with, without, difference);
  double most = 0;
  cv::minMaxLoc(difference, nullptr, &most);
  if (most == 0) return {};
  cv::compare(difference, most / 2, bright, cv::CMP_GT);
  return {cv::sum(difference)[0] / most, cv::boundingRect(bright)};
}

LinkModel ModelFor(const std::string& name) {
  if (name == "necked")
    return Altered("bottle", {{"[39.5, 39.5, 39, 37.5, 33, 29]", "[39.5, 39.5, 39, 36, 26, 39]"}});
  if (name == "narrow")
    return Altered("cylinder", {{"focal_px: 226.91", "focal_px: 400"},
                                {"k1_per_px2: 27.85e-7", "k1_per_px2: 0"},
                                {"k2_per_px4: -14.09e-11", "k2_per_px4: 0"}});
  return LoadLinkModel(name).value();
}

class RenderedVisibility : public ::testing::TestWithParam<std::string> {};

// Every eleventh marker, which is all rings and many paths.
TEST_P(RenderedVisibility, AreOfTheMarkersInRenderedImages) {
  const LinkModel model = ModelFor(GetParam());
  CameraEffects effects;
  effects.sensor_noise_levels = 0;
  effects.marker_jitter_px = 0;
  Renderer renderer(model, model.nominal_rig, effects, 1);
  const SkinTruth rest = TruthAt(model, SceneWith(""), 0);
  const SkinVisibility visibility = FindVisibility(model, RestGeometry(model));
  int seen = 0, hidden = 0, clipped = 0;
  for (const CameraId id : kBothCameras) {
    SkinTruth none = rest;
    for (Vec3& foot : none.marker_wall_mm) foot = Vec3(0, 1e6, 0);
    cv::Mat without, with;
    renderer.Render(none, id, without);
    without = without.clone();
    for (int m = 0; m < model.markers.count(); m += 11) {
      const auto i = static_cast<size_t>(m);
      SkinTruth one = none;
      one.marker_wall_mm[i] = rest.marker_wall_mm[i];
      renderer.Render(one, id, with);
      const Spot spot = SpotOf(with, without);
      const MarkerView& view = visibility[id][i];
      const std::string where = std::string(Name(id)) + " " + std::to_string(m) + ": " + Name(view.sight) +
                                ", " + std::to_string(view.clearance_mm);
      const bool at_edge =
          spot.box.x == 0 || spot.box.y == 0 || spot.box.br().x == with.cols || spot.box.br().y == with.rows;
      switch (view.sight) {
        case Sight::kSeen: {
          ++seen;
          EXPECT_GT(spot.weight, 0) << where;
          EXPECT_FALSE(at_edge) << where;
          // The outline's box, within a pixel and the soft edge.
          const Vec2 off = view.center_px - model.nominal_rig[id].lens.principal_point_px;
          const Vec2 along = off.normalized().cwiseAbs();
          const double width = std::hypot(view.along_px * along.x(), view.across_px * along.y());
          const double height = std::hypot(view.along_px * along.y(), view.across_px * along.x());
          EXPECT_NEAR(spot.box.width, width, 1.6 + 0.1 * width) << where;
          EXPECT_NEAR(spot.box.height, height, 1.6 + 0.1 * height) << where;
          break;
        }
        case Sight::kBehindWall:
          ++hidden;
          // The renderer shows what the wall covers by less than 0.3 mm.
          EXPECT_TRUE(spot.weight == 0 || view.clearance_mm > -0.35) << where;
          break;
        case Sight::kOutsideImage:
          ++clipped;
          EXPECT_TRUE(spot.weight == 0 || at_edge) << where;
          break;
        case Sight::kTurnedAway:  // a dome stands out of the wall: a part of it may show
        case Sight::kBehindTube:  // simulated links have no block in their tubes
          break;
        default:
          EXPECT_EQ(spot.weight, 0) << where;
      }
    }
  }
  EXPECT_GT(seen, 10);
  EXPECT_EQ(hidden > 0, GetParam() == "necked");
  EXPECT_EQ(clipped > 0, GetParam() == "narrow");
}

INSTANTIATE_TEST_SUITE_P(Models, RenderedVisibility,
                         ::testing::Values("cylinder", "barrel", "necked", "narrow"),
                         [](const auto& model) { return model.param; });

// Both cameras are on the axis: a line of sight stays in the half plane of its path, where it is straight.
TEST(Visibility, TubeHidesWhatIsBehindItsBlock) {
  for (const double tube_mm : {15.0, 24.0, 29.0}) {
    LinkModel model = LoadLinkModel("cylinder").value();
    model.tube_outer_radius_mm = tube_mm;
    const SkinVisibility visibility = FindVisibility(model, RestGeometry(model));
    for (const CameraId id : kBothCameras) {
      const double camera_z = id == CameraId::kTop ? -26.5 : 226.49;
      for (int ring = 0; ring < model.markers.rings(); ++ring) {
        const double z = 18.0 * (ring + 1), radius = 36.5 - 4 * 1.4 / (3 * kPi);
        const double share = (99 - camera_z) / (z - camera_z);  // of the way to the marker, at the block
        const bool hides = share < 1 && share * radius < tube_mm;
        const Sight sight = visibility[id][static_cast<size_t>(model.MarkerIndex(5, ring))].sight;
        EXPECT_EQ(sight == Sight::kBehindTube, hides) << tube_mm << " " << Name(id) << " " << ring;
      }
    }
  }
}

// (3.4) of the thesis: a camera in the plane of the skin's end whose lens ends at 75 degrees sees the wall
// from R cot(75 deg) on.
TEST(Visibility, BlindZoneIsThatOfTheViewAngle) {
  LinkModel model = LoadLinkModel("cylinder").value();
  model.tube_outer_radius_mm = 0;
  for (const CameraId id : kBothCameras) {
    CameraModel& camera = model.nominal_rig[id];
    const double half_angle = RadFromDeg(75);
    camera.lens = {.focal_px = 100, .principal_point_px = Vec2(500, 500), .kind = LensKind::kKannalaBrandt};
    camera.width_px = camera.height_px = static_cast<int>(2 * 100 * half_angle);
    camera.lens.principal_point_px = Vec2::Constant((camera.width_px - 1) / 2.0);
    const Vec3 at(0, 0, id == CameraId::kTop ? 0 : model.length_mm);
    camera.camera_from_link.translation = -(camera.camera_from_link.rotation * at);
  }
  const SkinVisibility visibility = FindVisibility(model, RestGeometry(model));
  const double blind_mm = 36.5 / std::tan(RadFromDeg(75));
  EXPECT_NEAR(blind_mm, 9.8, 0.1);
  EXPECT_NEAR(visibility.blind[Index(CameraId::kTop)].top_mm, blind_mm, 0.6);
  EXPECT_NEAR(visibility.blind[Index(CameraId::kBottom)].bottom_mm, blind_mm, 0.6);
  EXPECT_EQ(visibility.blind_to_both.top_mm, 0) << "the other camera looks there";
}

// (3.3) of the thesis: f D / distance px across.
TEST(Visibility, SizeIsTheFocalLengthTimesTheViewAngle) {
  LinkModel model = LoadLinkModel("cylinder").value();
  for (CameraModel& camera : model.nominal_rig.cameras) camera.lens.k1_per_px2 = camera.lens.k2_per_px4 = 0;
  const SkinVisibility visibility = FindVisibility(model, RestGeometry(model));
  for (int ring = 5; ring < model.markers.rings(); ++ring) {
    const double distance = 18.0 * (ring + 1) + 26.5;
    const MarkerView& view = visibility[CameraId::kTop][static_cast<size_t>(model.MarkerIndex(3, ring))];
    EXPECT_NEAR(view.across_px, 226.91 * 2.8 / distance, 0.03) << ring;
    EXPECT_LT(view.along_px, view.across_px) << "foreshortened";
  }
}

// Twice the diameter closes the gap to the next ring of the far end in the image.
TEST(Visibility, LargeMarkersOverlapInTheImage) {
  LinkModel model = LoadLinkModel("cylinder").value();
  const auto gap = [&] {
    return FindVisibility(model,
                          RestGeometry(model))[CameraId::kTop][static_cast<size_t>(model.MarkerIndex(0, 9))]
        .gap_px;
  };
  const double far_px = 226.91 * 36 * (1 / (162 + 26.5) - 1 / (180 + 26.5));  // between the last two rings
  EXPECT_GT(gap(), 0);
  EXPECT_LT(gap(), far_px);
  model.markers.diameter_mm = 9;
  EXPECT_LT(gap(), 0);
}

}  // namespace
}  // namespace taclink

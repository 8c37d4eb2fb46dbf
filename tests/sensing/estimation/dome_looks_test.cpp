#include "sensing/estimation/dome_looks.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sensing/camera/projection.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/dome.h"

namespace taclink {
namespace {

// A bulge that is a sine along the axis, whose tilt is known in closed form. The renderer's silhouettes are
// the truth.
class DomeLooksTest : public ::testing::TestWithParam<std::string> {
 protected:
  static constexpr double kBulgeMm = 12;

  Vec3 Outward(int marker) const {
    const double angle = model_.PathAngle(model_.PathOf(marker));
    return {std::cos(angle), std::sin(angle), 0};
  }
  double Ring(int marker) const {
    return model_.markers.rings_z_mm[static_cast<size_t>(model_.RingOf(marker))];
  }
  Vec3 Bulged(int marker) const {
    return model_.RestMarker(marker) +
           kBulgeMm * std::sin(kPi * Ring(marker) / model_.length_mm) * Outward(marker);
  }
  Vec3 Inward(int marker) const {
    const double z = Ring(marker),
                 slope = kBulgeMm * kPi / model_.length_mm * std::cos(kPi * z / model_.length_mm);
    const Vec3 normal = model_.OutwardNormal(model_.PathAngle(model_.PathOf(marker)), z);
    const double radial = normal.dot(Outward(marker)), rest_slope = -normal.z() / radial;
    return -(Outward(marker) - (rest_slope + slope) * Vec3::UnitZ()).normalized();
  }
  /// Of the error of where the domes are seen, pixels.
  double WorstPx(const DomeLooks& looks) const {
    const double rise = model_.markers.center_depth_mm - model_.thickness_mm;
    double worst = 0;
    for (int m = 0; m < model_.markers.count(); ++m) {
      for (size_t c = 0; c < kCameraCount; ++c) {
        const Vec3 inward = Inward(m);
        const auto seen = SilhouetteCentroid(projectors_[c], {.foot_mm = Bulged(m) - rise * inward,
                                                              .normal = -inward,
                                                              .radius_mm = model_.markers.diameter_mm / 2});
        const auto told = projectors_[c].Project(Bulged(m) + looks.Offset(static_cast<size_t>(m), c));
        if (seen && told) worst = std::max(worst, (*seen - *told).norm());
      }
    }
    return worst;
  }

  const LinkModel model_ = LoadLinkModel(GetParam()).value();
  const std::array<Projector, kCameraCount> projectors_ = {Projector(model_.nominal_rig[CameraId::kTop]),
                                                           Projector(model_.nominal_rig[CameraId::kBottom])};
  DomeLooks looks_{model_, {projectors_[0].center_in_link(), projectors_[1].center_in_link()}};
};

TEST_P(DomeLooksTest, FollowsTheTiltOfTheWall) {
  const double at_rest = WorstPx(looks_);
  Eigen::VectorXd u(3 * model_.markers.count());
  for (int m = 0; m < model_.markers.count(); ++m) {
    u.segment<3>(3 * m) = Bulged(m) - model_.RestMarker(m);
  }
  EXPECT_GT(looks_.Update(u), 0.05);
  EXPECT_GT(at_rest, 0.08);
  EXPECT_LT(WorstPx(looks_), 0.25 * at_rest);
  EXPECT_EQ(looks_.Update(u), 0) << "nothing has moved";
  looks_.Update(Eigen::VectorXd::Zero(u.size()));
  EXPECT_NEAR(WorstPx(looks_), at_rest, 1e-6) << "no memory";
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, DomeLooksTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink

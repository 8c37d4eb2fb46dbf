#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <vector>

#include "sensing/shell/pressed_skin.h"
#include "tests/sensing/estimation/pushed_skin.h"

namespace taclink {
namespace {

class GrossErrorsTest : public SkinEstimatorTest {
 protected:
  using Damage = std::function<Vec3(int marker, const Vec3& displacement_mm)>;

  SkinObservation Damaged(const Eigen::VectorXd& markers_mm, double kpa, const Damage& damage) const {
    Eigen::VectorXd damaged_mm = markers_mm;
    for (int m = 0; m < model_.markers.count(); ++m)
      damaged_mm.segment<3>(3 * m) = damage(m, markers_mm.segment<3>(3 * m));
    return Observe(damaged_mm, kpa, kNoiseMm);
  }
  // Every marker is taken for the next one around.
  Vec3 FromNextPath(const Eigen::VectorXd& markers_mm, int marker) const {
    const int other = model_.MarkerIndex((model_.PathOf(marker) + 1) % 24, model_.RingOf(marker));
    return model_.RestMarker(other) + markers_mm.segment<3>(3 * other) - model_.RestMarker(marker);
  }
  static void Hide(int stride, SkinObservation& observation) {
    for (size_t m = 0; m < observation.markers.information.size(); m += static_cast<size_t>(stride))
      observation.markers.information[m].setZero();
  }

  static constexpr double kNoiseMm = 0.05;
};

// Without a step or a tangent of the touched skin; and the next frame is answered.
TEST_F(GrossErrorsTest, EndTheFrameBeforeLoadsAreLookedFor) {
  for (const double kpa : {0.0, 1.0}) {
    const Pushed pushed = Push(model_, kpa, 1.3, 95, kpa > 0 ? 0.8 : 0.12, 4);
    ASSERT_TRUE(pushed.ok);
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    const auto is_upper = [&](int m) { return model_.RestMarker(m).z() > 95; };
    const std::vector<Damage> damages = {
        [&](int m, const Vec3& mm) { return is_upper(m) ? Vec3(mm + Vec3(4, 0, 0)) : mm; },
        [&](int m, const Vec3& mm) { return model_.PathOf(m) < 12 ? Vec3(mm + Vec3(0, 0, 4)) : mm; },
        [&](int, const Vec3& mm) {
          return Vec3(mm + 1.5 * Vec3(normal(random), normal(random), normal(random)));
        },
        [&](int m, const Vec3&) { return FromNextPath(pushed.markers_mm, m); }};
    for (const Damage& damage : damages) {
      for (const int stride : {0, 11}) {  // 11: a marker of that many is not seen
        SkinObservation bad = Damaged(pushed.markers_mm, kpa, damage);
        if (stride > 0) Hide(stride, bad);
        estimator_.Estimate(bad, estimate_);
        EXPECT_EQ(estimate_.failure, EstimateFailure::kGrossErrors);
        EXPECT_FALSE(estimate_.has_shape);
        EXPECT_EQ(estimate_.work.steps, 0);
        EXPECT_LE(estimate_.work.tangents, 1);
      }
      estimator_.Estimate(Observe(pushed.markers_mm, kpa, kNoiseMm), estimate_);
      EXPECT_EQ(estimate_.failure, EstimateFailure::kNone);
    }
  }
}

// Deep dents, pressure that is known badly, markers that are not seen and a few that are elsewhere.
TEST_F(GrossErrorsTest, AreNotWhatForcesDo) {
  for (const double kpa : {0.0, 0.5, 1.0}) {
    const Pushed pushed = Push(model_, kpa, 1.3, 95, kpa > 0 ? 1.6 * kpa : 0.3, 5);
    ASSERT_TRUE(pushed.ok) << kpa;
    SkinObservation seen = Observe(pushed.markers_mm, kpa, kNoiseMm);
    seen.loads.pressure_mpa += 1e-4;
    seen.loads.pressure_sigma_mpa = 1e-4;
    SkinObservation partial = seen;
    Hide(5, partial);
    SkinObservation with_wrong = seen;
    for (const size_t m : {40u, 130u, 200u}) with_wrong.markers.displacement_mm[m] += Vec3(6, -3, 5);
    for (const SkinObservation* observation : {&seen, &partial, &with_wrong}) {
      estimator_.Restart();
      estimator_.Estimate(*observation, estimate_);
      EXPECT_EQ(estimate_.failure, EstimateFailure::kNone) << kpa;
    }
  }
}

// A stamp that sticks, pressed in deeply and moved far along the wall.
TEST_F(GrossErrorsTest, AreNotStrongDrags) {
  struct Drag {
    double kpa, radius_mm, depth_mm, by_mm;
    bool is_along;
  };
  for (const Drag& drag : {Drag{0, 2.75, 9, 16, false}, Drag{1.5, 8, 14, 12, true}}) {
    const LinkModel model = LoadLinkModel("cylinder").value();
    PressedSkin skin(model, {});
    ASSERT_TRUE(skin.Inflate(1e-3 * drag.kpa).ok());
    const auto node = static_cast<size_t>(skin.mesh().NodeOfMarker(model, model.MarkerIndex(6, 4)));
    const Vec3 outward = skin.mesh().normals[node];
    const Vec3 top = skin.state().mids_mm[node] + (model.thickness_mm / 2 + 0.01) * outward;
    skin.AddBody(RigidStamp{top, -outward, drag.radius_mm}, true);
    const Vec3 in = -drag.depth_mm * outward,
               by = drag.by_mm *
                    (drag.is_along ? Vec3::UnitZ() : Vec3(-outward.y(), outward.x(), 0).normalized());
    ASSERT_TRUE(skin.Move({&in, 1}).ok() && skin.Move({&by, 1}).ok());
    Eigen::VectorXd markers_mm(3 * model.markers.count());
    for (int m = 0; m < model.markers.count(); ++m)
      markers_mm.segment<3>(3 * m) = skin.Marker(m) - model.RestMarker(m);
    SkinEstimator estimator(model);
    estimator.Estimate(Observe(markers_mm, drag.kpa, kNoiseMm), estimate_);
    EXPECT_EQ(estimate_.failure, EstimateFailure::kNone) << drag.kpa;
    ASSERT_EQ(estimate_.loads.loads.size(), 1U);
    const double force_n = skin.ContactOf(0).force_n.norm();
    EXPECT_NEAR(estimate_.loads.loads[0].force_n.norm(), force_n, 0.05 * force_n);
  }
}

}  // namespace
}  // namespace taclink

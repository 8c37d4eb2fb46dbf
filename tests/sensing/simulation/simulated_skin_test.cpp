#include "sensing/simulation/simulated_skin.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

constexpr char kAllTheTime[] = ", begin_s: 0, end_s: 4, ramp_s: 0}\n";

class SimulatedSkinTest : public ::testing::TestWithParam<std::string> {
 protected:
  SkinTruth Under(const std::string& more) const { return TruthAt(model_, SceneWith(more), 2); }
  LinkModel model_ = Model(GetParam());
};

TEST_P(SimulatedSkinTest, WithoutLoadNothingMoves) {
  const SkinTruth truth = Under("");
  for (int m = 0; m < model_.markers.count(); ++m) {
    const auto i = static_cast<size_t>(m);
    EXPECT_NEAR((truth.marker_mm[i] - model_.RestMarker(m)).norm(), 0, 1e-9);
    EXPECT_NEAR((truth.marker_wall_mm[i] - truth.marker_mm[i]).dot(truth.marker_normal[i]),
                model_.markers.center_depth_mm - model_.thickness_mm, 1e-9);
  }
  EXPECT_TRUE(truth.contacts.empty());
  EXPECT_NEAR(truth.inner_wall.largest_inward_change_mm, 0, 1e-9);
}

TEST_P(SimulatedSkinTest, ContactForceIsAsAsked) {
  const SkinTruth truth =
      Under(std::string("contacts:\n") + "  - {at: {path: 3, ring: 4}, force_n: 0.2, patch_diameter_mm: 20" +
            kAllTheTime + "  - {at: {angle_deg: 200, z_mm: 61}, force_n: 0.1" + kAllTheTime);
  ASSERT_EQ(truth.contacts.size(), 2U);
  EXPECT_NEAR(truth.contacts[0].force_n.norm(), 0.2, 1e-9);
  EXPECT_NEAR(truth.contacts[1].force_n.norm(), 0.1, 1e-9);
  EXPECT_NEAR((truth.total_force_n - truth.contacts[0].force_n - truth.contacts[1].force_n).norm(), 0, 1e-12);
  for (const TrueContact& contact : truth.contacts) {
    const double angle = std::atan2(contact.center_mm.y(), contact.center_mm.x());
    EXPECT_NEAR(contact.force_n.normalized().dot(model_.OutwardNormal(angle, contact.center_mm.z())), -1,
                1e-3);
    EXPECT_GT(contact.depth_mm, 1);
    EXPECT_FALSE(contact.limited);
  }
}

TEST_P(SimulatedSkinTest, DepthIsAsAskedAlsoUnderPressure) {
  const SkinTruth truth =
      Under(std::string("pressure_kpa: 1\ncontacts:\n") + "  - {at: {path: 2, ring: 5}, depth_mm: 5" +
            kAllTheTime + "  - {at: {path: 4, ring: 5}, depth_mm: 4" + kAllTheTime);
  ASSERT_EQ(truth.contacts.size(), 2U);
  EXPECT_NEAR(truth.contacts[0].depth_mm, 5, 0.1);
  EXPECT_NEAR(truth.contacts[1].depth_mm, 4, 0.1);
}

TEST_P(SimulatedSkinTest, StaysOutsideTheTube) {
  const SkinTruth truth =
      Under(std::string("contacts:\n  - {at: {path: 2, ring: 5}, force_n: 20") + kAllTheTime);
  ASSERT_EQ(truth.contacts.size(), 1U);
  EXPECT_TRUE(truth.contacts[0].limited);
  EXPECT_LT(truth.contacts[0].force_n.norm(), 20);
  const auto& radius = truth.inner_wall.radius_mm;
  EXPECT_GE(*std::min_element(radius.begin(), radius.end()), model_.tube_outer_radius_mm - 0.01);
  EXPECT_LT(*std::min_element(radius.begin(), radius.end()), model_.tube_outer_radius_mm + 1.5);
}

TEST_P(SimulatedSkinTest, PressureLiftsTheSkinEvenly) {
  const SkinTruth one = Under("pressure_kpa: 0.5\n"), two = Under("pressure_kpa: 1\n");
  const int ring = model_.markers.rings() / 2;
  for (int path = 0; path < model_.markers.paths; ++path) {
    const auto i = static_cast<size_t>(model_.MarkerIndex(path, ring));
    const Vec3 rest = model_.RestMarker(static_cast<int>(i));
    const double lift = (one.marker_mm[i] - rest).head<2>().dot(rest.head<2>().normalized());
    EXPECT_GT(lift, 0.5);
    // The mid-surface moves in proportion; the wall under the marker gets thinner by less and less.
    EXPECT_NEAR((two.marker_mm[i] - rest).norm(), 2 * (one.marker_mm[i] - rest).norm(), 0.01);
  }
  EXPECT_DOUBLE_EQ(two.pressure_mpa, 1e-3);
}

TEST_P(SimulatedSkinTest, ASlidingTouchMovesSmoothly) {
  const Scene scene = SceneWith(
      "contacts:\n  - {at: {angle_deg: 40, z_mm: 60}, move_to: {angle_deg: 90, z_mm: 130}, force_n: 0.15,\n"
      "     patch_diameter_mm: 8, begin_s: 0.5, end_s: 3.5, ramp_s: 0.5}\n");
  auto skin = SimulatedSkin::Make(model_, scene);
  ASSERT_TRUE(skin.ok());
  SkinTruth before, now;
  (*skin)->Evaluate(0, before);
  double largest_step = 0, last_z = 0;
  for (int step = 1; step < 200; ++step) {
    (*skin)->Evaluate(0.02 * step, now);
    for (size_t i = 0; i < now.marker_mm.size(); ++i)
      largest_step = std::max(largest_step, (now.marker_mm[i] - before.marker_mm[i]).norm());
    if (!now.contacts.empty()) {
      EXPECT_LE(now.contacts[0].force_n.norm(), 0.15 + 1e-9);
      EXPECT_GT(now.contacts[0].center_mm.z(), last_z);
      last_z = now.contacts[0].center_mm.z();
    }
    std::swap(before, now);
  }
  EXPECT_LT(largest_step, 0.6);  // mm in 20 ms; the ramps are the fastest part
}

TEST_P(SimulatedSkinTest, LoopsAndCountsOn) {
  const Scene scene =
      SceneWith("contacts:\n  - {at: {path: 2, ring: 3}, force_n: 0.1, begin_s: 1, end_s: 3}\n");
  const SkinTruth first = TruthAt(model_, scene, 1.5), later = TruthAt(model_, scene, 9.5);
  EXPECT_EQ(first.frame, 45U);
  EXPECT_EQ(later.frame, 285U);
  EXPECT_NEAR((first.marker_mm[50] - later.marker_mm[50]).norm(), 0, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, SimulatedSkinTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink

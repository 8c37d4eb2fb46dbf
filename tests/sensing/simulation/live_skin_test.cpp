#include "sensing/simulation/live_skin.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "sensing/core/units.h"
#include "sensing/simulation/simulated_skin.h"
#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

constexpr double kFrameS = 1.0 / 30;

Scene SceneOf(const std::string& more) {
  const auto scene =
      ParseScene("live.yaml", "taclink_scene: 1\nname: live\nduration_s: 60\n" + more + "refinement: 1\n");
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  return *scene;
}

/// A skin that is handled, frame by frame.
class HandledSkin {
 public:
  HandledSkin(const LinkModel& model, const Scene& scene) : skin_(*SimulatedSkin::Make(model, scene)) {}

  const SkinTruth& Play(const Handling& handling, double span_s) {
    skin_->Handle(handling);
    for (const double end_s = time_s_ + span_s; time_s_ < end_s - kFrameS / 2; time_s_ += kFrameS)
      skin_->Evaluate(time_s_, truth_);
    return truth_;
  }
  const SkinTruth& truth() const { return truth_; }

 private:
  std::unique_ptr<SimulatedSkin> skin_;
  SkinTruth truth_;
  double time_s_ = 0;
};

double LargestGap(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

PressedBody Disc(double angle_rad, double z_mm) {
  return {.id = 7,
          .shape = BodyShape::kDisc,
          .diameter_mm = 11,
          .at = {angle_rad, z_mm},
          .depth_mm = std::nullopt,
          .force_n = std::nullopt};
}

std::string Pressure(double kpa) {
  return "pressure_keyframes: [{time_s: 0, kpa: " + std::to_string(kpa) + "}]\n";
}

// A scene is solved by other code, from other states.
TEST(LiveSkinTest, IsTheEquilibriumThatASceneHas) {
  const LinkModel model = Model("cylinder");
  for (const double kpa : {0.0, 0.8}) {
    const std::string contact =
        "contacts:\n  - {at: {angle_deg: 40, z_mm: 80}, patch_diameter_mm: 11, force_n: " +
        std::string(kpa > 0 ? "0.4" : "0.12") + ", begin_s: 0, end_s: 60, ramp_s: 1}\n";
    SkinTruth solved;
    (*SimulatedSkin::Make(model, SceneOf(Pressure(kpa) + contact)))->Evaluate(30, solved);
    ASSERT_EQ(solved.contacts.size(), 1u);
    HandledSkin skin(model, SceneOf(Pressure(kpa)));
    PressedBody disc = Disc(RadFromDeg(40), 80);
    disc.force_n = kpa > 0 ? 0.4 : 0.12;
    const SkinTruth& live = skin.Play({.bodies = {disc}}, 2);
    ASSERT_EQ(live.contacts.size(), 1u);
    EXPECT_EQ(live.contacts[0].body_id, 7u);
    EXPECT_LT(LargestGap(live.marker_mm, solved.marker_mm), 0.05) << kpa << " kPa";
    EXPECT_LT((live.contacts[0].force_n - solved.contacts[0].force_n).norm(), 0.002);
    EXPECT_LT((live.contacts[0].center_mm - solved.contacts[0].center_mm).norm(), 0.2);
    EXPECT_EQ(live.trouble, "");
  }
}

TEST(LiveSkinTest, GoesBackToTheSceneOnceItIsLeftAlone) {
  const LinkModel model = Model("barrel");
  HandledSkin skin(model, SceneOf(Pressure(0.3)));
  const std::vector<Vec3> rest = skin.Play({}, 0.2).marker_mm;
  PressedBody disc = Disc(1, 70);
  disc.depth_mm = 6;
  EXPECT_GT(LargestGap(skin.Play({.bodies = {disc}}, 1).marker_mm, rest), 3);
  const SkinTruth& free = skin.Play({}, 1.5);
  EXPECT_EQ(LargestGap(free.marker_mm, rest), 0);
  EXPECT_TRUE(free.contacts.empty());
}

TEST(LiveSkinTest, BodiesSlideToWhereTheyAreWanted) {
  const LinkModel model = Model("cylinder");
  HandledSkin skin(model, SceneOf(Pressure(0)));
  PressedBody finger = {.id = 1, .shape = BodyShape::kFinger, .at = {0, 60}, .depth_mm = 6, .force_n = {}};
  skin.Play({.bodies = {finger}}, 1);
  finger.at = {RadFromDeg(60), 110};
  Vec3 before = skin.truth().contacts.at(0).center_mm;
  double fastest_mm = 0;
  for (int frame = 0; frame < 60; ++frame) {
    const SkinTruth& truth = skin.Play({.bodies = {finger}}, kFrameS);
    ASSERT_EQ(truth.contacts.size(), 1u);
    fastest_mm = std::max(fastest_mm, (truth.contacts[0].center_mm - before).norm());
    before = truth.contacts[0].center_mm;
  }
  EXPECT_LT(fastest_mm, 4);
  const Vec3 there = model.PointAtDepth(RadFromDeg(60), 110, 6);
  EXPECT_LT((before - there).norm(), 3);
}

TEST(LiveSkinTest, SeveralBodiesComeAndGoOneByOne) {
  const LinkModel model = Model("cylinder");
  HandledSkin skin(model, SceneOf(Pressure(0.5)));
  std::vector<PressedBody> bodies;
  for (uint64_t i = 0; i < 3; ++i)
    bodies.push_back({.id = 11 + i,
                      .shape = BodyShape::kFinger,
                      .at = {2.0 * static_cast<double>(i), 50 + 30.0 * static_cast<double>(i)},
                      .depth_mm = std::nullopt,
                      .force_n = 0.2 + 0.1 * static_cast<double>(i)});
  for (size_t count = 1; count <= 3; ++count)
    skin.Play({.bodies = {bodies.begin(), bodies.begin() + static_cast<std::ptrdiff_t>(count)}}, 0.7);
  ASSERT_EQ(skin.truth().contacts.size(), 3u);
  skin.Play({.bodies = {bodies[1], bodies[2]}}, 1.2);
  ASSERT_EQ(skin.truth().contacts.size(), 2u);
  for (const TrueContact& contact : skin.truth().contacts) {
    const double wanted_n = contact.body_id == 12 ? 0.3 : 0.4;
    EXPECT_NEAR(contact.force_n.norm(), wanted_n, 0.03 * wanted_n) << contact.body_id;
  }
}

// So hard that the skin would snap: they stop, and nevertheless go when nobody presses any more.
TEST(LiveSkinTest, BodiesThatCannotGoOnDoNotStay) {
  const LinkModel model = Model("cylinder");
  HandledSkin skin(model, SceneOf(Pressure(0.5)));
  std::vector<PressedBody> bodies;
  const auto press = [&](BodyShape shape, double angle_deg, double z_mm) {
    bodies.push_back({.id = 1 + bodies.size(),
                      .shape = shape,
                      .at = {RadFromDeg(angle_deg), z_mm},
                      .depth_mm = std::nullopt,
                      .force_n = 1});
  };
  press(BodyShape::kFinger, 0, 40);
  press(BodyShape::kSphere, 180, 100);
  press(BodyShape::kDisc, 45, 80);
  press(BodyShape::kHand, 20, 110);
  skin.Play({.bodies = bodies}, 4);
  ASSERT_GE(skin.truth().contacts.size(), 4u);
  ASSERT_FALSE(skin.truth().trouble.empty()) << "else this tests nothing";
  EXPECT_EQ(skin.Play({}, 4).contacts.size(), 0u);
}

// A regulator's pressure: the skin has it in the frame for which it is given, also while a body is stuck.
TEST(LiveSkinTest, APressureThatChangesIsThatOfItsFrame) {
  for (const bool is_stuck : {false, true}) {
    HandledSkin skin(Model("cylinder"), SceneOf(Pressure(0)));
    Handling handling;
    if (is_stuck)
      handling.bodies.push_back({.id = 1,
                                 .shape = BodyShape::kFinger,
                                 .at = {.angle_rad = 0.4, .z_mm = 100},
                                 .depth_mm = std::nullopt,
                                 .force_n = 1});
    skin.Play(handling, 1.5);
    ASSERT_EQ(skin.truth().trouble.empty(), !is_stuck);
    constexpr double kRateMpaps = 0.5e-3;
    double worst_mpa = 0;
    for (int frame = 0; frame < 30; ++frame) {
      handling.pressure_mpa = kRateMpaps * kFrameS * frame;
      handling.pressure_mpaps = kRateMpaps;
      skin.Play(handling, kFrameS);
      if (frame > 6)  // the first key was made without it
        worst_mpa = std::max(worst_mpa, std::abs(skin.truth().pressure_mpa - *handling.pressure_mpa));
    }
    EXPECT_LT(worst_mpa, is_stuck ? 20e-6 : 1e-9) << is_stuck;
    EXPECT_GT(skin.truth().pressure_mpa, 0.4e-3);
  }
}

TEST(LiveSkinTest, AHandPressesFromBothSides) {
  const LinkModel model = Model("barrel");
  HandledSkin skin(model, SceneOf(Pressure(0.5)));
  const PressedBody hand = {
      .id = 3, .shape = BodyShape::kHand, .at = {0.5, 70}, .depth_mm = 4, .force_n = std::nullopt};
  const SkinTruth& truth = skin.Play({.bodies = {hand}}, 1);
  ASSERT_EQ(truth.contacts.size(), 5u);
  double pressing_n = 0;
  for (const TrueContact& contact : truth.contacts) pressing_n += contact.force_n.norm();
  EXPECT_GT(pressing_n, 0.3);
  EXPECT_LT(truth.total_force_n.norm(), 0.5 * pressing_n);
}

// Pressure and joint move at their speeds, and come back.
TEST(LiveSkinTest, PressureAndJointFollow) {
  const LinkModel model = Model("cylinder");
  const std::string swing =
      "motion: {gravity_mps2: [0, 0, -9.81], swing: {axis: [1, 0, 0], pivot_mm: [0, 0, 0], mean_deg: 0, "
      "amplitude_deg: 0, period_s: 60, joint: j}}\n";
  HandledSkin skin(model, SceneOf(Pressure(0.5) + swing));
  skin.Play({.bodies = {}, .pressure_mpa = 0.001, .joint_rad = std::nullopt}, 0.3);
  EXPECT_GT(skin.truth().pressure_mpa, 0.0006);
  EXPECT_LT(skin.truth().pressure_mpa, 0.0009);
  skin.Play({.bodies = {}, .pressure_mpa = 0.001, .joint_rad = RadFromDeg(60)}, 3);
  EXPECT_NEAR(skin.truth().pressure_mpa, 0.001, 1e-9);
  EXPECT_NEAR(skin.truth().joint.rad, RadFromDeg(60), 0.01);
  const Vec3 gravity(0, -kStandardGravity * std::sin(RadFromDeg(60)), -kStandardGravity / 2);
  EXPECT_LT((skin.truth().specific_force_mps2 - gravity).norm(), 0.15);
  skin.Play({}, 4);
  EXPECT_EQ(skin.truth().pressure_mpa, 0.0005);
  EXPECT_EQ(skin.truth().joint.rad, 0);
}

// Deeper than any equilibrium: it stays on the way, says so, and can be taken off.
TEST(LiveSkinTest, WhatTheSkinCannotFollowStaysAndIsReported) {
  const LinkModel model = Model("barrel");
  HandledSkin skin(model, SceneOf(Pressure(0)));
  const std::vector<Vec3> rest = skin.Play({}, 0.1).marker_mm;
  std::vector<PressedBody> bodies;
  for (uint64_t i = 0; i < 8; ++i) {
    bodies.push_back({.id = i + 1,
                      .shape = BodyShape::kDisc,
                      .diameter_mm = 40,
                      .at = {static_cast<double>(i) * kPi / 4, 70},
                      .depth_mm = 25,
                      .force_n = std::nullopt});
  }
  const SkinTruth& truth = skin.Play({.bodies = bodies}, 1.5);
  EXPECT_THAT(truth.trouble, HasSubstr("no equilibrium"));
  const SkinTruth& free = skin.Play({}, 2);
  EXPECT_LT(LargestGap(free.marker_mm, rest), 1e-6);
}

TEST(HandlingTest, WhatIsNotPossibleIsRefusedWithWhatIs) {
  const LinkModel model = Model("cylinder");
  const Scene scene = SceneOf(Pressure(0));
  const auto why = [&](const Handling& handling) {
    const auto good = CheckHandling(model, scene, handling);
    return good ? std::string() : good.error().message;
  };
  PressedBody good = Disc(0, 80);
  good.depth_mm = 5;
  EXPECT_EQ(why({.bodies = {good}}), "");
  const auto but = [&](auto change) {
    PressedBody body = good;
    change(body);
    return why({.bodies = {body}});
  };
  EXPECT_THAT(but([](PressedBody& body) { body.id = 0; }), HasSubstr("id"));
  EXPECT_THAT(but([](PressedBody& body) { body.at.z_mm = 0; }), HasSubstr("between the clamped ends"));
  EXPECT_THAT(but([](PressedBody& body) { body.at.z_mm = 1e9; }), HasSubstr("between the clamped ends"));
  EXPECT_THAT(but([](PressedBody& body) { body.at.angle_rad = NAN; }), HasSubstr("angle"));
  EXPECT_THAT(but([](PressedBody& body) { body.diameter_mm = 100; }), HasSubstr("2 to 60 mm"));
  EXPECT_THAT(but([](PressedBody& body) { body.depth_mm = 100; }), HasSubstr("mm there"));
  EXPECT_THAT(but([](PressedBody& body) { body.force_n = 1; }), HasSubstr("not both"));
  EXPECT_THAT(but([](PressedBody& body) { body.depth_mm.reset(), body.force_n = 21; }), HasSubstr("20 N"));
  EXPECT_THAT(why({.bodies = std::vector<PressedBody>(17, good)}), HasSubstr("too many"));
  EXPECT_THAT(why({.bodies = {}, .pressure_mpa = 0.01}), HasSubstr("3 kPa"));
  EXPECT_THAT(why({.bodies = {}, .joint_rad = 1}), HasSubstr("no joint"));
}

}  // namespace
}  // namespace taclink

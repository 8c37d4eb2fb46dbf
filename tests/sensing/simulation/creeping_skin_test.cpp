// Skins that creep, against closed forms of the standard linear solid.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "sensing/core/units.h"
#include "sensing/simulation/live_skin.h"
#include "sensing/simulation/simulated_skin.h"
#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

constexpr double kShare = 0.2, kTimeS = 10;

// J(t) / J(0) of one term [fung1993, section 2.11].
double Compliance(double t_s) {
  return 1 / (1 - kShare) - kShare / (1 - kShare) * std::exp(-t_s * (1 - kShare) / kTimeS);
}
// J(t) / J(0) on the way to a load that grows evenly from 0 to ramp_s, by superposition.
double RampedCompliance(double t_s, double ramp_s) {
  const double rate = (1 - kShare) / kTimeS;
  const auto integral = [&](double t) {
    return t / (1 - kShare) + kShare / (1 - kShare) * std::exp(-t * rate) / rate;
  };
  return (integral(t_s) - integral(t_s - ramp_s)) / ramp_s;
}

LinkModel CreepingModel() {
  LinkModel model = Model("cylinder");
  model.relaxation.terms = {{kShare, kTimeS}};
  return model;
}

Scene CreepScene(const std::string& more) {
  const auto scene = ParseScene(
      "c.yaml", "taclink_scene: 1\nname: creep\nduration_s: 60\nloop: false\n" + more + "refinement: 1\n");
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  return *scene;
}

std::unique_ptr<SimulatedSkin> SkinOf(const LinkModel& model, const Scene& scene) {
  auto skin = SimulatedSkin::Make(model, scene);
  if (!skin) ADD_FAILURE() << skin.error().message;
  return skin ? std::move(*skin) : nullptr;
}

double MotionAt(SimulatedSkin& skin, int marker, double time_s) {
  SkinTruth now, before;
  skin.Evaluate(0, before);
  skin.Evaluate(time_s, now);
  const auto m = static_cast<size_t>(marker);
  return (now.marker_mm[m] - before.marker_mm[m]).norm();
}

TEST(CreepingSkinTest, AStepOfPressureInflatesAsTheCompliance) {
  const LinkModel model = CreepingModel();
  const std::string step = "pressure_keyframes: [{time_s: 1, kpa: 0}, {time_s: 1.2, kpa: 0.01}]\n";
  const auto skin = SkinOf(model, CreepScene(step));
  const auto elastic = SkinOf(Model("cylinder"), CreepScene(step));
  const int marker = model.MarkerIndex(3, 4);
  const double elastic_mm = MotionAt(*elastic, marker, 59);
  ASSERT_GT(elastic_mm, 0.005);
  for (const double t : {1.25, 3.0, 6.0, 12.0, 30.0, 60.0})
    EXPECT_NEAR(MotionAt(*skin, marker, t) / elastic_mm, RampedCompliance(t - 1, 0.2), 0.004) << t;
}

TEST(CreepingSkinTest, AConstantForceDentsAsTheComplianceAndStaysTheSame) {
  const LinkModel model = CreepingModel();
  const std::string press =
      "contacts:\n  - {at: {path: 7, ring: 5}, force_n: 0.002, patch_diameter_mm: 12, begin_s: 1, end_s: 60, "
      "ramp_s: 0.2}\n";
  const auto skin = SkinOf(model, CreepScene(press));
  const auto elastic = SkinOf(Model("cylinder"), CreepScene(press));
  const int marker = model.MarkerIndex(6, 4);
  const double elastic_mm = MotionAt(*elastic, marker, 59);
  ASSERT_GT(elastic_mm, 0.02);
  for (const double t : {2.0, 6.0, 12.0, 30.0, 59.5}) {
    EXPECT_NEAR(MotionAt(*skin, marker, t) / elastic_mm, Compliance(t - 1.1), 0.01) << t;
    SkinTruth truth;
    skin->Evaluate(t, truth);
    ASSERT_EQ(truth.contacts.size(), 1u);
    EXPECT_NEAR(truth.contacts[0].force_n.norm(), 0.002, 2e-5);
  }
}

// What superposition of the load and its removal leaves behind.
TEST(CreepingSkinTest, ADentRemainsAndRecovers) {
  const LinkModel model = CreepingModel();
  const std::string press =
      "contacts:\n  - {at: {path: 7, ring: 5}, force_n: 0.002, patch_diameter_mm: 12, begin_s: 1, end_s: 21, "
      "ramp_s: 0.2}\n";
  const auto skin = SkinOf(model, CreepScene(press));
  const auto elastic = SkinOf(Model("cylinder"), CreepScene(press));
  const int marker = model.MarkerIndex(6, 4);
  const double elastic_mm = MotionAt(*elastic, marker, 10);
  for (const double t : {21.5, 24.0, 30.0, 45.0}) {
    const double left = Compliance(t - 1.1) - Compliance(t - 20.9);
    EXPECT_NEAR(MotionAt(*skin, marker, t) / elastic_mm, left, 0.01) << t;
    SkinTruth truth;
    skin->Evaluate(t, truth);
    EXPECT_TRUE(truth.contacts.empty());
  }
  EXPECT_GT(MotionAt(*skin, marker, 21.5) / elastic_mm, 0.15);
}

// A held depth: the force falls to no less than the series says, and little more, for the wall under the disc
// is elastic; and where the disc is drawn back the skin pushes less than it was pushed: hysteresis takes up
// energy.
TEST(CreepingSkinTest, AForceRelaxesUnderAHeldDepthAndALoopTakesUpEnergy) {
  const LinkModel model = CreepingModel();
  const auto skin = SkinOf(
      model,
      CreepScene("contacts:\n  - {at: {path: 7, ring: 5}, depth_mm: 5, patch_diameter_mm: 12, begin_s: 1, "
                 "end_s: 58, ramp_s: 4}\n"));
  SkinTruth truth;
  const auto force_at = [&](double t) {
    skin->Evaluate(t, truth);
    return truth.contacts.empty() ? 0 : truth.contacts[0].force_n.norm();
  };
  const double peak_n = force_at(5);
  EXPECT_GT(peak_n, 0.05);
  // Half way through the ramp the load is as if it had come at once, nearly.
  const double series =
      (1 - kShare * (1 - std::exp(-47 / kTimeS))) / (1 - kShare * (1 - std::exp(-2 / kTimeS)));
  EXPECT_GT(force_at(50), (series - 0.02) * peak_n);
  EXPECT_LT(force_at(50), (series + 0.05) * peak_n);
  double work = 0, before_n = 0, before_mm = 0;
  bool is_in = false;
  for (double t = 1; t < 58; t += 0.02) {
    const double now_n = force_at(t);
    if (truth.contacts.empty()) continue;
    const double now_mm = truth.contacts[0].depth_mm;
    if (is_in) work += (now_n + before_n) / 2 * (now_mm - before_mm);
    is_in = true;
    before_n = now_n;
    before_mm = now_mm;
  }
  EXPECT_GT(work, 0.05 * peak_n * 5 / 2);  // N mm
}

PressedBody HeldDisc(double force_n) {
  return {.id = 7,
          .shape = BodyShape::kDisc,
          .diameter_mm = 12,
          .at = {0.5, 80},
          .depth_mm = std::nullopt,
          .force_n = force_n};
}

// A scene's contact and a user's body are solved by other code, in other steps.
TEST(CreepingSkinTest, ABodyThatIsHeldCreepsAsASceneDoes) {
  const LinkModel model = CreepingModel();
  const double angle_deg = DegFromRad(0.5);
  const auto scene =
      SkinOf(model, CreepScene("contacts:\n  - {at: {angle_deg: " + std::to_string(angle_deg) +
                               ", z_mm: 80}, force_n: 0.1, patch_diameter_mm: 12, begin_s: 0.2, end_s: 20.2, "
                               "ramp_s: 0.1}\n"));
  const auto handled = SkinOf(model, CreepScene(""));
  SkinTruth now, there;
  const auto apart_mm = [&](double t) {
    scene->Evaluate(t, there);
    double most = 0;
    for (size_t m = 0; m < now.marker_mm.size(); ++m)
      most = std::max(most, (now.marker_mm[m] - there.marker_mm[m]).norm());
    return most;
  };
  for (double t = 0; t < 40; t += 0.1) {
    if (std::abs(t - 0.2) < 1e-6) handled->Handle({.bodies = {HeldDisc(0.1)}});
    if (std::abs(t - 20) < 1e-6) handled->Handle({});
    handled->Evaluate(t, now);
    if (std::abs(t - 2) < 1e-6 || std::abs(t - 15) < 1e-6) {
      EXPECT_LT(apart_mm(t), 0.08) << t;
      EXPECT_NEAR(now.total_force_n.norm(), 0.1, 1e-3);
    }
    if (std::abs(t - 24) < 1e-6 || std::abs(t - 30) < 1e-6) {
      EXPECT_LT(apart_mm(t), 0.08) << t;
      EXPECT_EQ(now.total_force_n.norm(), 0);
    }
  }
}

TEST(CreepingSkinTest, TheLinearSkinSaysThatItDoesNotCreep) {
  const auto skin = SimulatedSkin::Make(CreepingModel(), CreepScene("skin: linear\n"));
  ASSERT_FALSE(skin.ok());
  EXPECT_THAT(skin.error().message, ::testing::HasSubstr("use 'skin: nonlinear'"));
}

}  // namespace
}  // namespace taclink

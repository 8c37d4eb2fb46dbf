#include "sensing/simulation/nonlinear_skin.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "sensing/shell/skin_push.h"
#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

// A short scene of a coarse nonlinear skin.
Scene NonlinearScene(const std::string& more) {
  const auto scene =
      ParseScene("n.yaml", "taclink_scene: 1\nname: n\nduration_s: 4\n" + more + "refinement: 1\n");
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  return *scene;
}

std::unique_ptr<SimulatedSkin> Skin(const LinkModel& model, const Scene& scene) {
  auto skin = SimulatedSkin::Make(model, scene);
  if (!skin) ADD_FAILURE() << skin.error().message;
  return skin ? std::move(*skin) : nullptr;
}

double Apart(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double most = 0;
  for (size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

std::vector<Vec3> MarkersOf(const LinkModel& model, const ShellMesh& mesh, const ShellState& state) {
  const MarkerMap map(model, mesh);
  std::vector<Vec3> markers;
  for (int m = 0; m < model.markers.count(); ++m)
    markers.push_back(map.Position(state.mids_mm, state.directors, m));
  return markers;
}

struct Played {
  std::string name, scene;
};
void PrintTo(const Played& played, std::ostream* out) {
  *out << played.name;
}

constexpr double kWeakN = 0.03;  // a tenth of these scenes' greatest forces or less

// Scenes of all kinds: what is played at any time is what is solved there.
class PlayedTest : public ::testing::TestWithParam<Played> {};

TEST_P(PlayedTest, IsTheEquilibriumAtAnyTime) {
  const LinkModel model = Model("cylinder");
  const Scene scene = NonlinearScene(GetParam().scene);
  const auto skin = Skin(model, scene);
  ASSERT_TRUE(skin);
  const auto plans = PlanContacts(model, scene);
  ASSERT_TRUE(plans.ok());
  SceneSolver solver(model, scene, *plans);
  const auto solved = solver.Solve();
  ASSERT_TRUE(solved.ok());
  std::mt19937 random(7);
  double worst_mm = 0, worst_share = 0, worst_residual = 0;
  for (const PlayedPart& part : solved->parts) {
    if (part.part.still) {
      EXPECT_EQ(part.keys.size(), 1u);
      continue;
    }
    for (int i = 0; i < 5; ++i) {
      const double t = std::uniform_real_distribution<double>(part.part.begin_s, part.part.end_s)(random);
      const auto after = std::find_if(part.keys.begin(), part.keys.end() - 1,
                                      [&](const SkinKey& key) { return key.time_s > t; });
      SkinBalance balance = solver.BalanceOf(*(after - 1), t - (after - 1)->time_s);
      SkinKey key;
      ASSERT_TRUE(solver.SolveAt(part.part, t, balance, key));
      const SkinLoad load = solver.loads().At(part.part, t);
      worst_residual = std::max(worst_residual, solver.skin().Residual(load, balance).cwiseAbs().maxCoeff());
      SkinTruth truth;
      skin->Evaluate(t, truth);
      worst_mm = std::max(worst_mm, Apart(truth.marker_mm, MarkersOf(model, solver.mesh(), balance.state)));
      for (const TrueContact& contact : truth.contacts) {
        const KeyContact& direct = key.contacts[static_cast<size_t>(contact.index)];
        const Vec3 force = direct.value.head<3>().cast<double>();
        worst_share =
            std::max(worst_share, (contact.force_n - force).norm() / std::max(force.norm(), kWeakN));
      }
    }
  }
  EXPECT_LT(worst_mm, 0.02);
  // A slide's force changes as the disc passes contact points; keys in time follow that to some percent.
  EXPECT_LT(worst_share, 0.06);
  EXPECT_LT(worst_residual, 1e-5);  // N, of contact forces of 0.1 N
  std::printf("%s: %s; markers within %.4f mm, forces within %.2f %%\n", GetParam().name.c_str(),
              skin->Preparation().c_str(), worst_mm, 100 * worst_share);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, PlayedTest,
    ::testing::Values(
        Played{"press", "contacts:\n  - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 1, end_s: 3}\n"},
        Played{"depth under changing pressure",
               "pressure_keyframes: [{time_s: 0.5, kpa: 0}, {time_s: 2, kpa: 1.5}, {time_s: 3.5, kpa: 0}]\n"
               "contacts:\n  - {at: {path: 2, ring: 5}, depth_mm: 4, patch_diameter_mm: 12, begin_s: 1, "
               "end_s: 3, ramp_s: 0.5}\n"},
        Played{"slide beside another",
               "pressure_kpa: 1\ncontacts:\n"
               "  - {at: {angle_deg: 40, z_mm: 60}, move_to: {angle_deg: 60, z_mm: 80}, force_n: 0.15,\n"
               "     patch_diameter_mm: 8, begin_s: 0.5, end_s: 3.5, ramp_s: 0.5}\n"
               "  - {at: {angle_deg: 90, z_mm: 75}, depth_mm: 2, patch_diameter_mm: 12, begin_s: 1, end_s: 3,"
               " ramp_s: 0.5}\n"},
        Played{
            "touched while it swings",
            "pressure_kpa: 0.5\nmotion: {swing: {amplitude_deg: 60, period_s: 4}}\n"
            "contacts:\n  - {at: {path: 2, ring: 5}, force_n: 0.2, begin_s: 0.7, end_s: 3, ramp_s: 0.5}\n"}));

class NonlinearSkinTest : public ::testing::TestWithParam<std::string> {
 protected:
  SkinTruth Under(const std::string& more) const {
    SkinTruth truth;
    if (const auto skin = Skin(model_, NonlinearScene(more))) skin->Evaluate(2, truth);
    return truth;
  }
  const LinkModel model_ = Model(GetParam());
};

constexpr char kAlways[] = ", begin_s: 0, end_s: 4, ramp_s: 0}\n";

TEST_P(NonlinearSkinTest, WithoutLoadNothingMoves) {
  const SkinTruth truth = Under("");
  EXPECT_LT(Apart(truth.marker_mm, model_.RestMarkers()), 1e-6);
  EXPECT_TRUE(truth.contacts.empty());
}

// PushSkin solves in another way.
TEST_P(NonlinearSkinTest, ForcesUnderPressureAreThoseOfAPush) {
  for (const double kpa : {0.5, 1.0, 1.5}) {
    SCOPED_TRACE(kpa);
    const SkinTruth truth = Under("pressure_kpa: " + std::to_string(kpa) +
                                  "\ncontacts:\n  - {at: {path: 5, ring: 5}, depth_mm: 3" + kAlways);
    const SkinPush push{
        .marker = model_.MarkerIndex(4, 4), .depth_mm = 3, .pressure_mpa = kpa * 1e-3, .refinement = 1};
    const auto pushed = PushSkin(model_, push);
    ASSERT_TRUE(pushed.ok()) << pushed.error().message;
    ASSERT_EQ(truth.contacts.size(), 1u);
    EXPECT_NEAR(truth.contacts[0].depth_mm, 3, 1e-6);
    EXPECT_GT(pushed->force_n, 0.1);
    EXPECT_NEAR(truth.contacts[0].force_n.norm(), pushed->force_n, 0.03 * pushed->force_n);
  }
}

TEST_P(NonlinearSkinTest, TwoForcesAreAsAsked) {
  const std::string first = "  - {at: {path: 3, ring: 4}, force_n: 0.1, patch_diameter_mm: 12";
  const std::string second = "  - {at: {path: 4, ring: 4}, force_n: 0.15, patch_diameter_mm: 12";
  const SkinTruth truth = Under("pressure_kpa: 1\ncontacts:\n" + first + kAlways + second + kAlways);
  ASSERT_EQ(truth.contacts.size(), 2u);
  EXPECT_NEAR(truth.contacts[0].force_n.norm(), 0.1, 1e-3);
  EXPECT_NEAR(truth.contacts[1].force_n.norm(), 0.15, 1.5e-3);
  EXPECT_FALSE(truth.contacts[0].limited || truth.contacts[1].limited);
  const SkinTruth alone = Under("pressure_kpa: 1\ncontacts:\n" + first + kAlways);
  ASSERT_EQ(alone.contacts.size(), 1u);
  EXPECT_GT(truth.contacts[0].depth_mm, alone.contacts[0].depth_mm + 0.1);  // the other helps
}

TEST_P(NonlinearSkinTest, LoopsEndWhereTheyBegin) {
  const auto skin = Skin(model_, NonlinearScene("pressure_keyframes: [{time_s: 1, kpa: 0.2}, {time_s: 2, "
                                                "kpa: 0.8}, {time_s: 3, kpa: 0.2}]\n"
                                                "contacts:\n  - {at: {path: 2, ring: 3}, force_n: 0.1, "
                                                "begin_s: 1.5, end_s: 3.5, ramp_s: 0.5}\n"));
  ASSERT_TRUE(skin);
  SkinTruth begin, end, again;
  skin->Evaluate(0, begin);
  skin->Evaluate(4 - 1e-9, end);
  skin->Evaluate(4, again);
  EXPECT_LT(Apart(begin.marker_mm, end.marker_mm), 1e-3);
  EXPECT_EQ(Apart(begin.marker_mm, again.marker_mm), 0);
  skin->Evaluate(2.5, begin);
  skin->Evaluate(10.5, again);
  EXPECT_EQ(Apart(begin.marker_mm, again.marker_mm), 0);
  EXPECT_EQ(again.frame, 315u);
}

TEST_P(NonlinearSkinTest, ASlidingTouchKeepsItsForceAndMovesSmoothly) {
  const auto skin = Skin(
      model_,
      NonlinearScene(
          "pressure_kpa: 1\ncontacts:\n  - {at: {angle_deg: 40, z_mm: 60}, move_to: {angle_deg: 60, z_mm: "
          "90}, force_n: 0.15,\n     patch_diameter_mm: 8, begin_s: 0.5, end_s: 3.5, ramp_s: 0.5}\n"));
  ASSERT_TRUE(skin);
  SkinTruth before, now;
  skin->Evaluate(0, before);
  double largest_step = 0;
  for (int step = 1; step < 200; ++step) {
    const double t = 0.02 * step;
    skin->Evaluate(t, now);
    largest_step = std::max(largest_step, Apart(before.marker_mm, now.marker_mm));
    if (t > 1.01 && t < 2.99) {
      ASSERT_EQ(now.contacts.size(), 1u);
      EXPECT_NEAR(now.contacts[0].force_n.norm(), 0.15, 0.0015);
      EXPECT_NEAR(now.contacts[0].center_mm.z(), 60 + 10 * (t - 0.5), 4);
    }
    std::swap(before, now);
  }
  EXPECT_LT(largest_step, 0.3);  // mm in 20 ms
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, NonlinearSkinTest, ::testing::Values("cylinder", "barrel"));

// CalculiX's solid of the same skin sags by 3.6 mm.
TEST(NonlinearSkin, SagsByItsWeight) {
  const LinkModel model = Model("cylinder");
  const auto markers = [&](const std::string& more) {
    SkinTruth truth;
    if (const auto skin = Skin(model, NonlinearScene(more))) skin->Evaluate(0, truth);
    return truth.marker_mm;
  };
  const auto upright = markers("motion: {}\n"), lying = markers("motion: {gravity_mps2: [0, -9.81, 0]}\n");
  EXPECT_NEAR(Apart(upright, lying), 3.6, 0.4);
  EXPECT_LT(Apart(upright, model.RestMarkers()), 0.5);
}

TEST(NonlinearSkin, ASceneWithoutEquilibriumIsRefusedWithItsPlaceAndTime) {
  const auto near_end = SimulatedSkin::Make(
      Model("cylinder"),
      NonlinearScene("contacts:\n  - {at: {angle_deg: 20, z_mm: 6}, depth_mm: 20, begin_s: 1, end_s: 3}\n"));
  ASSERT_FALSE(near_end.ok());
  EXPECT_EQ(near_end.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(near_end.error().message, HasSubstr("n.yaml:5"));
  EXPECT_THAT(near_end.error().message, HasSubstr("at 1."));
  EXPECT_THAT(near_end.error().message, HasSubstr("smaller depth"));
  const auto sucked =
      SimulatedSkin::Make(Model("cylinder"), NonlinearScene("pressure_keyframes: [{time_s: 1, kpa: 0}, "
                                                            "{time_s: 2, kpa: -3}]\nloop: false\n"));
  ASSERT_FALSE(sucked.ok());
  EXPECT_THAT(sucked.error().message, HasSubstr("scene 'n'"));
  EXPECT_THAT(sucked.error().message, HasSubstr("smaller pressure"));
}

TEST(NonlinearSkin, StaysOutsideTheTube) {
  const LinkModel model = Model("cylinder");
  const auto under = [&](const std::string& contact) {
    SkinTruth truth;
    const auto skin =
        Skin(model, NonlinearScene("contacts:\n  - {at: {path: 2, ring: 5}, " + contact + kAlways));
    if (skin) skin->Evaluate(2, truth);
    return truth;
  };
  const SkinTruth by_force = under("force_n: 20"), by_depth = under("depth_mm: 60");
  for (const SkinTruth& truth : {by_force, by_depth}) {
    ASSERT_EQ(truth.contacts.size(), 1u);
    EXPECT_TRUE(truth.contacts[0].limited);
    EXPECT_LT(truth.contacts[0].force_n.norm(), 20);
    const auto& radius = truth.inner_wall.radius_mm;
    const double nearest = *std::min_element(radius.begin(), radius.end());
    EXPECT_GE(nearest, model.tube_outer_radius_mm - 0.01);
    EXPECT_LT(nearest, model.tube_outer_radius_mm + 1.5);
  }
  EXPECT_NEAR(by_force.contacts[0].depth_mm, by_depth.contacts[0].depth_mm, 1e-4);
}

}  // namespace
}  // namespace taclink

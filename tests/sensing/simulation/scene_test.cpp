#include "sensing/simulation/scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

std::string Message(const std::string& more) {
  const auto scene = ParseScene("s.yaml", "taclink_scene: 1\nname: s\nduration_s: 4\n" + more);
  return scene.ok() ? "accepted" : scene.error().message;
}

TEST(Scene, ShippedOnesBeginUntouchedAndFitBothEnds) {
  EXPECT_THAT(ShippedSceneNames(),
              ::testing::UnorderedElementsAre("rest", "press", "two_touches", "stroke", "inflate",
                                              "swing_lower", "swing_upper", "swing_tip"));
  for (const std::string& name : ShippedSceneNames()) {
    SCOPED_TRACE(name);
    const auto scene = LoadScene(name);
    ASSERT_TRUE(scene.ok()) << scene.error().message;
    EXPECT_EQ(scene->name, name);
    EXPECT_TRUE(scene->loop);
    for (int i = 0; i <= 10; ++i) EXPECT_EQ(scene->PressureKpa(0.1 * i), 0);
    EXPECT_EQ(scene->PressureKpa(scene->duration_s), 0);
    for (const SceneContact& contact : scene->contacts) EXPECT_GE(contact.begin_s, 1);
    EXPECT_EQ(scene->skin, SkinKind::kNonlinear);
    Scene coarse = *scene;
    coarse.refinement = 1;
    const auto skin = SimulatedSkin::Make(Model(scene->model), coarse);
    EXPECT_TRUE(skin.ok()) << skin.error().message;
  }
}

TEST(Scene, SaysHowTheSkinAnswers) {
  const auto scene = [](const std::string& more) {
    return ParseScene("s.yaml", "taclink_scene: 1\nname: s\nduration_s: 4\n" + more).value();
  };
  EXPECT_EQ(scene("").skin, SkinKind::kNonlinear);
  EXPECT_EQ(scene("").refinement, 2);
  EXPECT_EQ(scene("skin: nonlinear\nrefinement: 3\n").refinement, 3);
  EXPECT_EQ(scene("skin: linear\n").skin, SkinKind::kLinear);
  const auto bad = ParseScene("s.yaml", "taclink_scene: 1\nname: s\nduration_s: 4\nskin: stiff\n");
  ASSERT_FALSE(bad.ok());
  EXPECT_THAT(bad.error().message, ::testing::HasSubstr("s.yaml:4"));
}

TEST(Scene, ReadsMotion) {
  const auto scene = ParseScene(
      "s.yaml",
      "taclink_scene: 1\nname: s\nduration_s: 8\nmotion:\n  gravity_mps2: [0, -9.81, 0]\n"
      "  swing: {axis: [0, 0, 2], pivot_mm: [1, 2, 3], mean_deg: 45, amplitude_deg: 30, period_s: 4}\n");
  ASSERT_TRUE(scene.ok()) << scene.error().message;
  ASSERT_TRUE(scene->motion && scene->motion->swing);
  EXPECT_EQ(scene->motion->gravity_mps2, Vec3(0, -9.81, 0));
  const Swing& swing = *scene->motion->swing;
  EXPECT_EQ(swing.axis, Vec3::UnitZ());
  EXPECT_EQ(swing.pivot_mm, Vec3(1, 2, 3));
  EXPECT_NEAR(swing.At(0).rad, RadFromDeg(15), 1e-12);
  EXPECT_NEAR(swing.At(2).rad, RadFromDeg(75), 1e-12);
  EXPECT_FALSE(ParseScene("s.yaml", "taclink_scene: 1\nname: s\nduration_s: 4\n")->motion);
}

TEST(Scene, RefusesMotionThatItCannotPlay) {
  const std::string swing = "motion: {swing: {amplitude_deg: 30, period_s: 3}}\n";
  EXPECT_THAT(Message(swing), AllOf(HasSubstr("duration_s"), HasSubstr("period_s")));
  EXPECT_EQ(Message(swing + "loop: false\n"), "accepted");
  EXPECT_THAT(Message("motion: {swing: {axis: [0, 0, 0], amplitude_deg: 3, period_s: 4}}\n"),
              AllOf(HasSubstr("s.yaml:4"), HasSubstr("axis")));
  EXPECT_THAT(Message("motion: {gravity: [0, 0, -9.8]}\n"), HasSubstr("gravity_mps2"));
  EXPECT_THAT(Message("motion: {swing: {amplitude_deg: 360, period_s: 0.1, pivot_mm: [0, 0, -500]}}\n"),
              AllOf(HasSubstr("100 m/s2"), HasSubstr("amplitude")));
  EXPECT_THAT(Message("motion: {}\nskin: linear\n"), AllOf(HasSubstr("motion"), HasSubstr("nonlinear")));
  EXPECT_THAT(
      Message("motion: {}\ncontacts:\n  - {at: {path: 2, ring: 3}, depth_mm: 2, begin_s: 1, end_s: 3}\n"),
      AllOf(HasSubstr("s.yaml:6"), HasSubstr("force_n")));
}

// By differences of where the point is in the room.
TEST(SceneMotion, SpecificForceIsGravityLessAcceleration) {
  const Swing swing{.axis = Vec3(1, 2, -1).normalized(),
                    .pivot_mm = {30, -20, -200},
                    .mean_rad = 0.4,
                    .amplitude_rad = 1.2,
                    .period_s = 3};
  const SceneMotion motion{.gravity_mps2 = {1, 2, -9}, .swing = swing};
  const Vec3 point_mm(5, 10, 95);
  for (const double t : {0.0, 0.4, 1.1, 1.5, 2.9}) {
    SCOPED_TRACE(t);
    const auto rotation = [&](double s) { return Mat3(Eigen::AngleAxisd(swing.At(s).rad, swing.axis)); };
    const auto place_m = [&](double s) { return Vec3(1e-3 * (rotation(s) * (point_mm - swing.pivot_mm))); };
    constexpr double kStepS = 1e-4;
    const Vec3 acceleration =
        (place_m(t + kStepS) - 2 * place_m(t) + place_m(t - kStepS)) / (kStepS * kStepS);
    const Vec3 expected = rotation(t).transpose() * (motion.gravity_mps2 - acceleration);
    EXPECT_LT((motion.SpecificForce(t, point_mm) - expected).norm(), 1e-5);
  }
}

TEST(Scene, ReadsEveryField) {
  const Scene scene = SceneWith(
      "model: barrel\nframe_rate_hz: 60\nloop: false\nseed: 7\n"
      "pressure_keyframes: [{time_s: 1, kpa: 0}, {time_s: 3, kpa: 1}]\n"
      "contacts:\n"
      "  - {at: {path: 2, ring: 3}, force_n: 0.5, begin_s: 1, end_s: 3}\n"
      "  - {at: {angle_deg: 90, z_mm: 50}, move_to: {angle_deg: 180, z_mm: 60}, patch_diameter_mm: 9,\n"
      "     depth_mm: 4, begin_s: 0, end_s: 4, ramp_s: 1}\n"
      "camera: {marker_jitter_px: 0.3, sensor_noise_levels: 1, blur_px: 0.5, exposure: 2, glow: 0, "
      "vignetting: 0}\n");
  EXPECT_EQ(scene.model, "barrel");
  EXPECT_EQ(scene.frame_rate_hz, 60);
  EXPECT_FALSE(scene.loop);
  EXPECT_EQ(scene.seed, 7U);
  EXPECT_NEAR(scene.PressureKpa(0), 0, 1e-12);
  EXPECT_NEAR(scene.PressureKpa(2.5), 0.75, 1e-12);
  EXPECT_NEAR(scene.PressureKpa(4), 1, 1e-12);
  ASSERT_EQ(scene.contacts.size(), 2U);
  EXPECT_EQ(scene.contacts[0].at.path, 2);
  EXPECT_EQ(scene.contacts[0].at.ring, 3);
  EXPECT_EQ(scene.contacts[0].patch_diameter_mm, 5.5);
  EXPECT_EQ(scene.contacts[0].force_n, 0.5);
  EXPECT_FALSE(scene.contacts[0].move_to.has_value());
  EXPECT_EQ(scene.contacts[1].depth_mm, 4);
  EXPECT_NEAR(scene.contacts[1].move_to.value_or(SkinPlace()).angle_rad, kPi, 1e-12);
  EXPECT_EQ(scene.camera.marker_jitter_px, 0.3);
  EXPECT_EQ(scene.camera.glow, 0);
}

TEST(Scene, BadInputIsNamedWithFileAndLine) {
  const std::string at = "contacts:\n  - {at: {path: 1, ring: 1}, ";
  EXPECT_THAT(Message("colour: red\n"), HasSubstr("s.yaml:4: 'colour' is not a known key"));
  EXPECT_THAT(Message("frame_rate_hz: fast\n"), HasSubstr("s.yaml:4: 'frame_rate_hz' must be a number"));
  EXPECT_THAT(Message(at + "begin_s: 1, end_s: 2}\n"), HasSubstr("s.yaml:5: 'contacts[0].force_n'"));
  EXPECT_THAT(Message(at + "force_n: 1, depth_mm: 1, begin_s: 1, end_s: 2}\n"), HasSubstr("exactly one"));
  EXPECT_THAT(Message(at + "force_n: 1, begin_s: 3, end_s: 2}\n"), HasSubstr("must be after begin_s"));
  EXPECT_THAT(Message(at + "force_n: 1, begin_s: 1, end_s: 2, ramp_s: 0.6}\n"), HasSubstr("fit twice"));
  EXPECT_THAT(Message(at + "force_n: -1, begin_s: 1, end_s: 2}\n"), HasSubstr("at least 0"));
  EXPECT_THAT(Message(at + "force_n: 1, begin_s: 1, end_s: 9}\n"), HasSubstr("at most 4"));
  EXPECT_THAT(Message("contacts:\n  - {at: {path: 1}, force_n: 1, begin_s: 1, end_s: 2}\n"),
              HasSubstr("'contacts[0].at.ring' is missing"));
  EXPECT_THAT(Message("pressure_kpa: 1\npressure_keyframes: [{time_s: 0, kpa: 0}]\n"),
              HasSubstr("give only one"));
  EXPECT_THAT(Message("pressure_keyframes: [{time_s: 1, kpa: 0}, {time_s: 1, kpa: 0}]\n"),
              HasSubstr("must rise"));
  EXPECT_THAT(Message("camera: {blur_px: -1}\n"), HasSubstr("camera.blur_px"));
  EXPECT_EQ(LoadScene("no-such-scene").error().code, ErrorCode::kNotFound);
  EXPECT_THAT(LoadScene("no-such-scene").error().message, HasSubstr("two_touches"));
}

TEST(Scene, AContactBesideTheModelIsNamedWithItsLine) {
  const auto message = [](const std::string& at) {
    const Scene scene = SceneWith("contacts:\n  - {at: " + at + ", force_n: 1, begin_s: 1, end_s: 2}\n");
    return SimulatedSkin::Make(Model("cylinder"), scene).error().message;
  };
  EXPECT_THAT(message("{path: 25, ring: 1}"),
              HasSubstr("s.yaml:5: marker (25, 1) is not on model 'cylinder'"));
  EXPECT_THAT(message("{angle_deg: 0, z_mm: 300}"), HasSubstr("s.yaml:5: 'z_mm' must lie between"));
}

}  // namespace
}  // namespace taclink

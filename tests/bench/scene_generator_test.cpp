#include "bench/vision/scene_generator.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "sensing/model/model_file.h"
#include "sensing/shell/linear_shell.h"
#include "sensing/simulation/linear_skin.h"

namespace taclink {
namespace {

class SceneGeneratorTest : public ::testing::Test {
 protected:
  std::vector<LinkModel> models_ = {LoadLinkModel("cylinder").value(), LoadLinkModel("barrel").value()};
};

std::string Fingerprint(const EvaluationScene& scene) {
  std::string text = scene.name + " " + std::to_string(scene.frames) + " " + std::to_string(scene.scene.seed);
  for (const SceneContact& c : scene.scene.contacts)
    text += " " + std::to_string(c.depth_mm.value_or(-1)) + " " + std::to_string(c.at.path) + " " +
            std::to_string(c.at.z_mm) + " " + std::to_string(c.ramp_s);
  for (const PressureKey& key : scene.scene.pressure) text += " " + std::to_string(key.kpa);
  const CameraEffects& camera = scene.scene.camera;
  return text + " " + std::to_string(camera.exposure) + " " + std::to_string(camera.mount[1].turn_rad.x());
}

TEST_F(SceneGeneratorTest, EveryCategoryAndModelIsThere) {
  std::map<SceneCategory, std::set<std::string>> seen;
  for (const EvaluationScene& scene : GenerateScenes(models_, 2 * kSceneCategoryCount, 1))
    seen[scene.category].insert(scene.model);
  EXPECT_EQ(seen.size(), static_cast<size_t>(kSceneCategoryCount));
  for (const auto& [category, names] : seen) EXPECT_EQ(names.size(), 2U) << Name(category);
}

TEST_F(SceneGeneratorTest, ASeedMakesTheSameScenesInEverySet) {
  const auto few = GenerateScenes(models_, 40, 5), many = GenerateScenes(models_, 80, 5);
  const auto barrels = GenerateScenes({models_[1]}, 30, 5);
  const auto others = GenerateScenes(models_, 40, 6);
  ASSERT_EQ(few.size(), 40U);
  ASSERT_EQ(many.size(), 80U);
  std::map<std::string, std::string> by_name;
  for (const auto& scene : many) by_name[scene.name] = Fingerprint(scene);
  EXPECT_EQ(by_name.size(), 80U);
  for (size_t i = 0; i < few.size(); ++i) {
    EXPECT_EQ(Fingerprint(few[i]), by_name[few[i].name]);
    EXPECT_NE(Fingerprint(few[i]), Fingerprint(others[i]));
    const auto one = GenerateScene(models_, few[i].name, 5);
    ASSERT_TRUE(one.ok()) << one.error().message;
    EXPECT_EQ(Fingerprint(*one), Fingerprint(few[i]));
  }
  for (const auto& scene : barrels) EXPECT_EQ(Fingerprint(scene), by_name[scene.name]);
}

TEST_F(SceneGeneratorTest, UnknownNamesAreRefused) {
  for (const char* name :
       {"", "rest", "rest-cylinder-", "rest-cylinder-0", "rest-cylinder-x", "nap-barrel-1"})
    EXPECT_EQ(GenerateScene(models_, name, 1).error().code, ErrorCode::kNotFound) << name;
}

// Also that the skin really goes where the scene says: each on its model, at rest first, within the limits.
TEST_F(SceneGeneratorTest, ScenesAreWithinTheirLimitsAndBeginAtRest) {
  std::map<std::string, std::pair<const LinkModel*, std::shared_ptr<const LinearShell>>> links;
  for (const LinkModel& model : models_)
    links[model.name] = {&model, std::make_shared<LinearShell>(model, 1)};
  double deepest = 0, strongest = 0;
  for (const EvaluationScene& scene : GenerateScenes(models_, 144, 2)) {
    SCOPED_TRACE(scene.name);
    EXPECT_GT(scene.frames, kRestFrames + 10);
    EXPECT_LT(scene.frames, 200);
    for (const SceneContact& contact : scene.scene.contacts) {
      EXPECT_GE(contact.begin_s * scene.scene.frame_rate_hz, kRestFrames);
      EXPECT_LE(contact.end_s, scene.scene.duration_s);
      EXPECT_LE(*contact.depth_mm, 15);
      EXPECT_LE(*contact.depth_mm / contact.ramp_s, 30 + 1e-9);  // mm/s, on average
      deepest = std::max(deepest, *contact.depth_mm);
    }
    const auto& [model, shell] = links[scene.model];
    auto skin = LinearSkin::Make(*model, scene.scene, shell);
    ASSERT_TRUE(skin.ok()) << skin.error().message;
    SkinTruth truth;
    for (int frame = 0; frame < kRestFrames; ++frame) {
      (*skin)->Evaluate(frame / scene.scene.frame_rate_hz, truth);
      EXPECT_LT((truth.marker_mm[17] - model->RestMarker(17)).norm(), 1e-9);
    }
    for (const PressureKey& key : scene.scene.pressure) strongest = std::max(strongest, key.kpa);
  }
  EXPECT_GT(deepest, 13);
  EXPECT_LE(strongest, 2.5);
  EXPECT_GT(strongest, 2);
}

}  // namespace
}  // namespace taclink

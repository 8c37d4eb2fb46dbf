#pragma once

#include <gtest/gtest.h>

#include <string>

#include "sensing/model/model_file.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {

/// A short scene of a linear skin with `more` lines of YAML.
inline Scene SceneWith(const std::string& more) {
  const auto scene =
      ParseScene("s.yaml", "taclink_scene: 1\nname: s\nduration_s: 4\n" + more + "skin: linear\n");
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  return *scene;
}

inline LinkModel Model(const std::string& name) {
  return LoadLinkModel(name).value();
}

inline SkinTruth TruthAt(const LinkModel& model, const Scene& scene, double time_s) {
  auto skin = SimulatedSkin::Make(model, scene);
  EXPECT_TRUE(skin.ok()) << skin.error().message;
  SkinTruth truth;
  (*skin)->Evaluate(time_s, truth);
  return truth;
}

}  // namespace taclink

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/simulation/scene.h"

namespace taclink {

/// What a scene is about. The first group moves the skin, the second disturbs the pictures; in both every
/// drawn marker jitters by 0.3 px but in `kClean`.
enum class SceneCategory : int {
  kRest,       ///< nothing happens
  kInflation,  ///< to 0.5 to 2.5 kPa and back
  kOneDent,    ///< to 15 mm, anywhere: on and between markers, near the clamped ends; some under pressure
  kTwoDents,
  kThreeDents,
  kPlate,       ///< a flat plate on the side: its depth falls off along and around the skin
  kPinch,       ///< two opposite
  kRing,        ///< squeezed all around
  kFastPush,    ///< 30 mm/s inwards
  kFastSlide,   ///< a dent that slides at 30 mm/s
  kClean,       ///< one or two dents, without jitter: what the method itself leaves
  kNoise,       ///< pixel noise of 0.1 to 2 times the nominal 2 levels
  kExposure,    ///< 1/4 to 4 times
  kFlicker,     ///< a gain of its own for each picture
  kDefocus,     ///< blur of 0.9 to 1.6 px instead of 0.7
  kDirt,        ///< specks on both lenses
  kMisaligned,  ///< cameras up to 2 mm and 2 degrees off
  kMixed,       ///< milder doses of all the disturbances at once
};
inline constexpr int kSceneCategoryCount = 18;
const char* Name(SceneCategory category);

/// Untouched frames at the beginning of every scene.
inline constexpr int kRestFrames = 10;

struct EvaluationScene {
  std::string name;  ///< category-model-number: makes the scene again, whatever else is in the set
  SceneCategory category = SceneCategory::kRest;
  std::string model;
  Scene scene;
  int frames = 0;
};

/// `count` scenes, one of each category and model by turns. The same seed gives the same scenes, and a scene
/// does not depend on `count` or on which other models are asked for.
std::vector<EvaluationScene> GenerateScenes(const std::vector<LinkModel>& models, int count, uint64_t seed);

/// One scene by its name. Errors: kNotFound.
Result<EvaluationScene> GenerateScene(const std::vector<LinkModel>& models, const std::string& name,
                                      uint64_t seed);

}  // namespace taclink

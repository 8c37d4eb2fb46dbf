#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "bench/vision/scene_generator.h"
#include "bench/vision/vision_method.h"
#include "bench/vision/vision_score.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink {

/// Elements per interval of the marker grid of the truth. Estimators use 2 at most.
inline constexpr int kVisionTruthRefinement = 4;

/// One frame of one scene, with what each method made of it (in the order of the methods).
struct BenchFrame {
  const EvaluationScene& scene;
  int frame = 0;
  const StereoFrame& pictures;
  const std::array<cv::Mat, kCameraCount>& gray;
  const VisionTruth& truth;
  const std::vector<VisionResult>& results;
};

struct VisionBenchOptions {
  std::vector<VisionMethodKind> methods;
  int truth_refinement = kVisionTruthRefinement;
  int jobs = 1;  ///< scenes at the same time
  /// Called from the workers, one at a time. May be empty.
  std::function<void(int done, int all)> progress;
  std::function<void(const BenchFrame&)> on_frame;  ///< jobs = 1 only
};

struct SceneOutcome {
  std::string name;
  SceneCategory category = SceneCategory::kRest;
  std::string model;
  int frames = 0;
  std::vector<VisionScore> scores;  ///< by method
  std::vector<Incidents> incidents;
};

/// Plays every scene and gives the same pictures to every method. `models` holds those the scenes name.
/// Results do not depend on `jobs`, but for times. Errors: kInvalidArgument (a scene does not fit its model).
Result<std::vector<SceneOutcome>> RunVisionBench(const std::vector<LinkModel>& models,
                                                 const std::vector<EvaluationScene>& scenes,
                                                 const VisionBenchOptions& options);

}  // namespace taclink

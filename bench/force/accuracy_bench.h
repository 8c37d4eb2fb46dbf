#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "bench/force/accuracy_score.h"
#include "bench/force/accuracy_truth.h"
#include "bench/force/force_method.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/core/skin_shape.h"
#include "sensing/pipeline/state_estimator.h"

namespace taclink {

struct AccuracyOptions {
  std::vector<ForceMethod> methods;
  /// Standard deviations of the markers across the axis, mm; three times as much along it. 0: exact markers.
  std::vector<double> noises_mm = {0, 0.05, 0.1};
  int frames = 4;  ///< of each scene, each with noise of its own; two of exact markers
  uint64_t seed = 1;
  int jobs = 1;  ///< methods at the same time
  /// Called from the workers, one at a time. May be empty.
  std::function<void(int done, int all)> progress;
};

/// A scored stage of a path, with the scores of its frames.
struct SceneScores {
  const PathTruth* path = nullptr;
  const TrueStage* truth = nullptr;
  std::vector<FrameScore> frames;
};

/// What one method made of one model's scenes with one noise.
struct AccuracyOutcome {
  ForceMethod method;
  std::string model;  ///< of the link
  double noise_mm = 0;
  std::vector<SceneScores> scenes;
  std::map<std::string, int> answered;  ///< frames by the force model that the estimator names
  std::vector<float> cpu_ms;            ///< of frames with contacts
  std::vector<float> rest_cpu_ms;       ///< of frames without pressure, weight and contacts
  int frames = 0, not_converged = 0;
  double construction_s = 0;  ///< CPU time
  double memory_mb = 0;       ///< resident, that the estimator adds to a process
};

/// Markers of a stage, from its baseline, as a camera pair would give them: noise and covariance as said.
/// Exact markers are given a standard deviation of 0.01 mm.
void MakeShape(const LinkModel& model, const TrueStage& truth, double noise_mm, uint64_t seed,
               SkinShape& shape);

/// A path's known loads as a link would have them: the pressure as it is, the specific force of a skin with
/// weight with an error of 0.2 m/s^2 in each component; the baseline's exact.
LoadsPair LoadsOf(const PressPath& path, double pressure_sigma_mpa, uint64_t seed);

/// Shows every method the same frames, path by path, stage by stage; estimators are restarted before a path.
/// `truths` must outlive the outcomes. Results do not depend on `jobs`, but for times.
std::vector<AccuracyOutcome> RunAccuracyBench(const LinkModel& model, const std::vector<PathTruth>& truths,
                                              const AccuracyOptions& options);

/// Solves or reads all paths.
Result<std::vector<PathTruth>> MakeTruths(const LinkModel& model, const std::vector<PressPath>& paths,
                                          int refinement, const std::string& folder, int jobs,
                                          const std::function<void(int done, int all)>& progress);

}  // namespace taclink

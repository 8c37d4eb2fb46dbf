#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bench/force/accuracy_bench.h"
#include "bench/vision/vision_report.h"

namespace taclink {

/// Of the chosen scenes' frames. Percentages are of each contact's true force.
struct AccuracySummary {
  int frames = 0;         ///< all
  int loaded_frames = 0;  ///< with a contact in truth
  int contacts = 0, missed = 0;
  int force_told = 0, center_told = 0;  ///< contacts whose error is within two standard deviations as told
  double size_n = 0, size_percent = 0, size_percent_p95 = 0;  ///< mean, mean, percentile
  double vector_n = 0, vector_percent = 0;                    ///< means
  double direction_deg = 0;                                   ///< median; missed ones left out
  double center_mm = 0, center_mm_p95 = 0;                    ///< median, percentile; missed ones left out
  double phantom_n = 0, stray_n = 0;                          ///< largest; mean
  int phantom_frames = 0;                                     ///< with more than 0.03 N of phantoms
  int within = 0, vector_within = 0;                          ///< of loaded_frames
};
using ChosenScene = std::function<bool(const SceneScores&)>;
AccuracySummary Summarize(const AccuracyOutcome& outcome, const ChosenScene& chosen);
AccuracySummary Summarize(const AccuracyOutcome& outcome);

/// Everything, by noise; then by kind of scene, by pressure and by attitude, with `detail_noise_mm`. A frame
/// that another force model answered, which the costs tell, counts as the one that was asked for.
std::vector<ReportTable> AccuracyTables(const std::vector<AccuracyOutcome>& outcomes, double detail_noise_mm);

/// How many of the path's scenes there are.
int ScenesOf(const PathTruth& truth);
/// What is not in the scenes, and why.
ReportTable FailedPaths(const std::vector<PathTruth>& truths);

/// Mean error of contact forces' size against median CPU time, one point a method and refinement. SVG.
std::string AccuracyPlot(const std::vector<AccuracyOutcome>& outcomes, double noise_mm);

}  // namespace taclink

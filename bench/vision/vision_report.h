#pragma once

#include <string>
#include <vector>

#include "bench/vision/vision_bench.h"

namespace taclink {

struct ReportTable {
  std::string title;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
};

/// The tables of a run: all methods over all scenes, by category, consistency of covariances, time by stage.
std::vector<ReportTable> VisionTables(const std::vector<SceneOutcome>& outcomes,
                                      const std::vector<VisionMethodKind>& methods);

std::string AlignedText(const ReportTable& table);
std::string Markdown(const ReportTable& table);

/// The sum of one method's scores over the scenes that `chosen` takes.
template <typename Chosen>
VisionScore SumScores(const std::vector<SceneOutcome>& outcomes, size_t method, const Chosen& chosen) {
  VisionScore sum;
  for (const SceneOutcome& outcome : outcomes) {
    if (chosen(outcome)) sum.Add(outcome.scores[method]);
  }
  return sum;
}
VisionScore SumScores(const std::vector<SceneOutcome>& outcomes, size_t method);

/// Plot of error (RMSE of the position, markers seen by both cameras) against CPU time per pair, one point a
/// method and model; both axes logarithmic. SVG.
std::string ErrorTimePlot(const std::vector<SceneOutcome>& outcomes,
                          const std::vector<VisionMethodKind>& methods);

}  // namespace taclink

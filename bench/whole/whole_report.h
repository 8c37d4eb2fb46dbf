#pragma once

#include <string>
#include <vector>

#include "bench/vision/vision_report.h"
#include "bench/whole/whole_bench.h"

namespace taclink {

/// Counts of frames after the baseline was taken.
struct WholeSummary {
  int frames = 0, ok = 0, refused = 0;         ///< refused: without forces
  int right = 0;                               ///< of all frames
  int silent = 0;                              ///< of `ok` frames
  int bodies = 0, within_2_sigma = 0;          ///< of `ok` frames
  int above_limit = 0, found_above_limit = 0;  ///< likewise; see WholeFrame
  int shape_within = 0;          ///< `ok` and every marker within 1 mm (of the shipped cylinder)
  double true_n = 0, off_n = 0;  ///< of bodies in frames that have forces
  double cpu_mean_ms = 0, cpu_median_ms = 0, cpu_p99_ms = 0, cpu_worst_ms = 0;
  int to_be_named = 0, named = 0;  ///< scenes whose fault has a name, and was named
  double named_after_s = 0;        ///< from the fault's beginning to the first such reason, the longest
};
WholeSummary Summarize(const std::vector<const WholeOutcome*>& outcomes);

/// By kind of scene, undisturbed ones first with their sum; then those with faults.
std::vector<ReportTable> WholeTables(const std::vector<WholeOutcome>& outcomes);

/// A row for each method and link.
ReportTable WholeMethodTable(const std::vector<WholeOutcome>& outcomes);
/// Error of the forces against CPU time, a point for each method and link. SVG.
std::string WholeMethodPlot(const std::vector<WholeOutcome>& outcomes);

}  // namespace taclink

#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "client/command/logs/solve_log_report.h"
#include "client/command/logs/solve_log_settings.h"
#include "sensing/core/result.h"

namespace taclink::command {

struct SolveLogSummary {
  std::vector<LinkReport> links;  ///< that were solved
  double recorded_s = 0;          ///< from the log's first message to its last
  double wall_s = 0;              ///< that solving and writing took
  int jobs = 0;                   ///< threads that solved
  uint64_t bytes = 0;             ///< of the new log
};

/// Told now and then: messages of the log that are done, and all of them.
using SolveProgress = std::function<void(uint64_t done, uint64_t all)>;

/// Takes the pictures of a log (of links without pictures: the markers) through the pipeline again and writes
/// a new log with the results, in the old one's order and at its times. Pictures are streamed. What belongs
/// to the old results is left out (/contacts, /events), all else copied. After an error there is no new log.
/// Errors: as FindSettings, LogLinkSolver::Solve and mcap::FileSink::Create; kInvalidArgument (a damaged or
/// unfinished log; where).
Result<SolveLogSummary> SolveLog(const SolveLogOptions& options, const SolveProgress& progress);

}  // namespace taclink::command

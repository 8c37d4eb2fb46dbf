#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/pipeline/link_pipeline.h"

namespace taclink::command {

/// Pictures of files, one pair after the other, beginning with a rest pair.
class PictureSolver {
 public:
  /// `calibration`: file; empty: the rest pair calibrates. `rest`, as all pairs: top, bottom; taken under
  /// `rest_pressure_mpa` and `rest_force`, without which the skin counts as weightless.
  /// Errors: kNotFound, kInvalidArgument (unreadable, of no use; why).
  static Result<std::unique_ptr<PictureSolver>> Make(
      const LinkModel& model, PipelineOptions options, const std::string& calibration,
      const std::vector<std::string>& rest, const std::optional<SpecificForceReading>& rest_force = {},
      double rest_pressure_mpa = 0);

  /// Whether it was measured is in the state. `pressure_mpa`: none: nobody tells it.
  Result<LinkState> Solve(const std::vector<std::string>& pair, std::optional<double> pressure_mpa,
                          const std::optional<SpecificForceReading>& specific_force = {});

 private:
  PictureSolver(const LinkModel& model, const PipelineOptions& options) : pipeline_(model, options) {}

  LinkPipeline pipeline_;
  StereoFrame frame_;
  LinkState state_;
};

}  // namespace taclink::command

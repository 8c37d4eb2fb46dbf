#pragma once

#include <vector>

#include "bench/vision/vision_bench.h"
#include "client/command/cli/json.h"

namespace taclink::command {

/// {"seed", "truth_refinement", "methods": [{"name", "description", "all": SCORE, "by_model": {NAME: SCORE},
/// "by_category": {NAME: SCORE}}], "scenes": [{"name", "category", "model", "frames", "methods": {NAME:
/// SCORE and what was wrong}}]}. Lengths mm, times ms.
Json BenchJson(const std::vector<SceneOutcome>& outcomes, const std::vector<VisionMethodKind>& methods,
               uint64_t seed);

}  // namespace taclink::command

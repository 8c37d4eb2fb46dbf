#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "mcap/reader.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/pipeline/link_pipeline.h"

namespace taclink::command {

/// What is to be solved in another way than it was.
struct SolveLogOptions {
  std::string input, output;
  std::vector<std::string> links = {};                      ///< none: all; the others stay as they are
  std::optional<std::string> force_model = {};              ///< "auto" or a model's name
  std::optional<int> force_refinement = {};                 ///< 0 to 3
  std::vector<std::string> models = {}, calibrations = {};  ///< LINK=FILE, or FILE for all solved links
  int jobs = 0;                                             ///< threads; 0: one for each CPU
  bool pictures = true;                                     ///< are in the new log too
};

/// What one link is solved with.
struct LinkSettings {
  std::string name;
  LinkModel model = {};
  PipelineOptions options = {};
  std::optional<std::string> new_model = {},
                             new_calibration = {};  ///< texts of files other than the recorded
  std::map<std::string, std::string> changes = {};  ///< what is not as recorded, by its name
  std::vector<std::string> warnings = {};
};

/// Of the links that are solved, in the order of their names. Errors: kNotFound (no such link or file),
/// kInvalidArgument (a file that is none, records that can't be understood; which).
Result<std::vector<LinkSettings>> FindSettings(const mcap::Reader& log, const SolveLogOptions& options);

}  // namespace taclink::command

#pragma once

#include <map>
#include <string>

#include "sensing/core/result.h"
#include "sensing/pipeline/link_pipeline.h"

namespace taclink {

/// What the server's configuration can set of a link's pipeline, by name, as texts: from it the link can be
/// solved again in the same way. Numbers are the same again when they are read. Without the cameras.
std::map<std::string, std::string> OptionsText(const PipelineOptions& options);

/// All else is as PipelineOptions has it. Errors: kInvalidArgument (a key that is missing or not known, a
/// value that is none; the message names it).
Result<PipelineOptions> ParseOptionsText(const std::map<std::string, std::string>& text);

/// "auto" and the names of the models; none: the cheapest that is good enough. Errors: kInvalidArgument.
std::string ForceModelText(const std::optional<ForceModel>& model);
Result<std::optional<ForceModel>> ParseForceModel(const std::string& text);

}  // namespace taclink

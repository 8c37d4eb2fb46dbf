#pragma once

#include <optional>
#include <string>

#include "sensing/pipeline/drift_options.h"
#include "sensing/yaml/yaml_reader.h"

namespace taclink::server {

/// A link's section `drift`; none: the baseline does not follow (`follow: false`).
std::optional<DriftOptions> ReadDrift(YamlMap& link);
/// As lines of a link in the configuration file.
std::string DriftText(const std::optional<DriftOptions>& drift);

}  // namespace taclink::server

#pragma once

#include <string>
#include <vector>

#include "server/config.h"

namespace taclink::server {

struct ConfigFindings {
  std::vector<std::string> errors;  ///< the server would not start, or a link could not work
  std::vector<std::string> notes;   ///< it would, but see to it
};

/// Makes all that the configuration names (models, scenes, calibrations, picture folders) without starting
/// anything, and looks at the cameras' names.
ConfigFindings CheckConfig(const Config& config);

}  // namespace taclink::server

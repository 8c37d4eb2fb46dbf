#pragma once

#include <string>
#include <vector>

#include "server/config/config.h"

namespace taclink::server {

struct ConfigFindings {
  std::vector<std::string> errors;  ///< the server would not start, or a link could not work
  std::vector<std::string> notes;   ///< it would, but see to it
};

/// Makes all that the configuration names (models, scenes, calibrations, picture folders; certificate and
/// tokens) without starting anything, and looks at the cameras' names, at the addresses to listen on, at
/// where it would write, and at what is open to other machines, which `insecure_open` allows.
ConfigFindings CheckConfig(const Config& config, bool insecure_open);

}  // namespace taclink::server

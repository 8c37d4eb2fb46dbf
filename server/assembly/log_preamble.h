#pragma once

#include "server/config/config.h"
#include "server/recording/log_file.h"

namespace taclink::server {

/// The configuration, the links' models, calibrations and pipeline options, the URDF; version, machine,
/// clock. Files that can't be read are left out and the log says so.
LogPreamble MakePreamble(const Config& config, const std::string& version);

}  // namespace taclink::server

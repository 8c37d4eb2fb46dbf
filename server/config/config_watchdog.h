#pragma once

#include <ostream>

#include "sensing/yaml/yaml_reader.h"
#include "server/config/realtime_options.h"
#include "server/config/watchdog_options.h"

namespace taclink::server {

/// The section `watchdog` of the configuration.
WatchdogOptions ReadWatchdog(YamlMap& root);
void WriteWatchdog(std::ostream& out, const WatchdogOptions& options);

/// The section `realtime`, of the file for all links or of one link, which inherits what it does not say.
RealtimeOptions ReadRealtime(YamlMap& map, const RealtimeOptions& inherited);
void WriteRealtime(std::ostream& out, const std::string& indent, const RealtimeOptions& options);

}  // namespace taclink::server

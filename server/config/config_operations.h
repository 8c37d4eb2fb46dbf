#pragma once

#include <chrono>
#include <ostream>

#include "sensing/yaml/yaml_reader.h"
#include "server/config/log_options.h"

namespace taclink::server {

struct ShutdownConfig {
  std::chrono::milliseconds limit{2000};  ///< for clients to take the news and leave; real time
};

/// The sections `log` and `shutdown` of the configuration.
LogOptions ReadLog(YamlMap& root);
void WriteLog(std::ostream& out, const LogOptions& options);
ShutdownConfig ReadShutdown(YamlMap& root);
void WriteShutdown(std::ostream& out, const ShutdownConfig& config);

}  // namespace taclink::server

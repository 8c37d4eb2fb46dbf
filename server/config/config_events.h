#pragma once

#include <string>

#include "sensing/yaml/yaml_reader.h"
#include "server/config/event_options.h"

namespace taclink::server {

/// The file's section `events`; `folder` is what a relative audit file is relative to.
EventOptions ReadEvents(YamlMap& root, const std::string& folder);
/// A link's sections `thresholds` and `regions`. Whether regions fit the link's model shows later.
LinkRules ReadRules(YamlMap& link);

// As in the configuration file.
std::string EventsText(const EventOptions& events);
std::string RulesText(const LinkRules& rules);

}  // namespace taclink::server

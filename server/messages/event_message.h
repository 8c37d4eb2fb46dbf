#pragma once

#include <string>

#include "server/events/event_engine.h"
#include "taclink/v1/events.pb.h"

namespace taclink::server {

void Fill(const Event& event, const std::string& link, v1::Event& out);
void Fill(const Thresholds& thresholds, v1::Thresholds& out);
Thresholds FromWire(const v1::Thresholds& thresholds);
/// `rules`: of the link that it is of.
void Fill(const LevelReport& report, const LinkRules& rules, v1::ForceLevelState& out);

}  // namespace taclink::server

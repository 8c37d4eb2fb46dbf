#pragma once

#include <string>

#include "taclink/v1/events.pb.h"

namespace taclink::command {

/// One line each, without its end.
std::string EventJson(const v1::Event& event, const std::string& run_id);
std::string EventText(const v1::Event& event);

}  // namespace taclink::command

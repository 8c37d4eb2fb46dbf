#pragma once

#include <string>

#include "client/cpp/taclink/client.h"

namespace taclink::command {

/// One line each, without its end.
std::string EventJson(const client::Event& event, const std::string& run_id);
std::string EventText(const client::Event& event);

}  // namespace taclink::command

#pragma once

#include <spdlog/sinks/sink.h>

#include <memory>
#include <string_view>

#include "server/config/options.h"

namespace taclink::server {

/// A longer message is cut.
inline constexpr size_t kMostMessageBytes = 4096;

/// The name in "link NAME: ...", or nothing.
std::string_view LinkOf(std::string_view message);

/// Before a sink: lets as many messages through as `rates` say, then counts, and tells the counts when the
/// minute is over, with the next message of any kind or a flush, or at its end. A message's source is what
/// stands before its first ": ", without a port. A message without its place in the program counts as one
/// with those that differ from it in numbers only.
std::shared_ptr<spdlog::sinks::sink> LimitRate(std::shared_ptr<spdlog::sinks::sink> sink,
                                               const LogRates& rates);

}  // namespace taclink::server

#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "mcap/reader.h"
#include "server/replay/log_player.h"
#include "wire/log/topics.h"

namespace taclink::server {

/// What of a log is to be played.
struct LogSelection {
  std::vector<std::string> links = {};  ///< none: all
  bool frames = true, events = true, contacts = true, arm = true, losses = true;
  bool joints = false;
};

struct LogChannels {
  std::map<uint16_t, wire::log::Topic> topics;
  std::map<uint16_t, PlayedChannel> played;  ///< the same channels
};

/// Links that the log has frames of, in the order of its channels.
std::vector<std::string> LinksOf(const mcap::Reader& reader);

/// Only channels of the API's messages, whatever else the log holds. Errors: kNotFound (no such link, with
/// those there are).
Result<LogChannels> ChooseChannels(const mcap::Reader& reader, const LogSelection& selection);

}  // namespace taclink::server

#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <string>

#include "sensing/core/result.h"
#include "server/replay/log_channels.h"
#include "server/replay/log_player.h"
#include "wire/log/replayed.h"

namespace taclink::server {

/// What a Replay call asks for.
struct ReplayOrder {
  std::string log;
  LogSelection selection;
  PlayerOptions player;  ///< but for the channels
  wire::log::ReplayedForm form;
};

/// Checked as far as that goes without the log. Errors: kInvalidArgument.
Result<ReplayOrder> ParseReplayRequest(const grpc::ByteBuffer& bytes);

}  // namespace taclink::server

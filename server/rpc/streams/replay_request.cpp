#include "server/rpc/streams/replay_request.h"

#include "server/rpc/requests/request_check.h"
#include "taclink/v1/recording.pb.h"
#include "wire/convert.h"

namespace taclink::server {

Result<ReplayOrder> ParseReplayRequest(const grpc::ByteBuffer& bytes) {
  const auto parsed = ParseRequest<v1::ReplayRequest>(bytes);
  if (!parsed) return parsed.error();
  const v1::ReplayRequest& request = *parsed;
  if (const auto good = LogPlayer::CheckSpeed(request.speed()); !good) return good.error();
  return ReplayOrder{.log = request.log(),
                     .selection = {.links = {request.links().begin(), request.links().end()},
                                   .frames = !request.without_frames(),
                                   .events = !request.without_events(),
                                   .contacts = !request.without_contacts(),
                                   .arm = !request.without_arm()},
                     .player = {.from_utc_ns = request.from_utc_ns(),
                                .to_utc_ns = request.to_utc_ns(),
                                .speed = request.speed(),
                                .loop = request.loop(),
                                .paused = request.paused()},
                     .form = {.detail = wire::FromWire(request.detail()),
                              .links = {request.links().begin(), request.links().end()}}};
}

}  // namespace taclink::server

#include "server/rpc/streams/stream_request.h"

#include <utility>

#include "server/arm/link_names.h"
#include "server/rpc/requests/request_check.h"
#include "taclink/v1/tactile.grpc.pb.h"
#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

Deadband ToDeadband(const v1::StreamFramesRequest& request) {
  return Deadband{.force_n = request.deadband_force_n(),
                  .move_mm = request.deadband_move_m() / wire::kMetresPerMm};
}

}  // namespace

Result<FrameStreamOptions> ParseStreamRequest(const grpc::ByteBuffer& bytes,
                                              const std::vector<std::string>& link_names,
                                              const ServiceLimits& limits) {
  const auto request = ParseRequest<v1::StreamFramesRequest>(bytes);
  if (!request) return request.error();
  auto links = FindLinks(link_names, request->links());
  if (!links) return links.error();
  const bool every = request->delivery() == v1::DELIVERY_EVERY;
  FrameStreamOptions options;
  options.detail = wire::FromWire(request->detail());
  options.subscriber.links = std::move(*links);
  options.subscriber.delivery = every ? Delivery::kEvery : Delivery::kLatest;
  options.subscriber.max_rate_hz = request->max_rate_hz();
  options.subscriber.queue_capacity = limits.queue_messages;
  options.subscriber.queue_bytes = limits.queue_bytes;
  options.subscriber.detail = options.detail;
  options.subscriber.deadband = ToDeadband(*request);
  return options;
}

}  // namespace taclink::server

#include "server/rpc/stream_request.h"

#include <cmath>
#include <utility>

#include "server/link_names.h"
#include "taclink/v1/tactile.grpc.pb.h"
#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

Result<Deadband> ParseDeadband(const v1::StreamFramesRequest& request) {
  for (const double limit : {request.deadband_force_n(), request.deadband_move_m()}) {
    if (!std::isfinite(limit / wire::kMetresPerMm) || limit < 0)
      return Invalid(
          "deadband_force_n and deadband_move_m must be positive numbers of N and m, or 0 for none");
  }
  return Deadband{.force_n = request.deadband_force_n(),
                  .move_mm = request.deadband_move_m() / wire::kMetresPerMm};
}

}  // namespace

Result<FrameStreamOptions> ParseStreamRequest(const grpc::ByteBuffer& bytes,
                                              const std::vector<std::string>& link_names,
                                              const ServiceLimits& limits) {
  v1::StreamFramesRequest request;
  grpc::ByteBuffer copy(bytes);  // parsing empties it
  if (!grpc::SerializationTraits<v1::StreamFramesRequest>::Deserialize(&copy, &request).ok()) {
    return Invalid("the request is no StreamFramesRequest message");
  }
  if (!v1::Detail_IsValid(request.detail())) return Invalid("detail must be CONTACTS, GEOMETRY or FULL");
  if (!v1::Delivery_IsValid(request.delivery())) return Invalid("delivery must be LATEST or EVERY");
  if (!std::isfinite(request.max_rate_hz()) || request.max_rate_hz() < 0) {
    return Invalid("max_rate_hz must be a positive number of Hz, or 0 for no limit");
  }
  const auto deadband = ParseDeadband(request);
  if (!deadband) return deadband.error();
  auto links = FindLinks(link_names, request.links());
  if (!links) return links.error();
  const bool every = request.delivery() == v1::DELIVERY_EVERY;
  return FrameStreamOptions{.subscriber = {.links = std::move(*links),
                                           .delivery = every ? Delivery::kEvery : Delivery::kLatest,
                                           .max_rate_hz = request.max_rate_hz(),
                                           .queue_capacity = limits.queue_messages,
                                           .queue_bytes = limits.queue_bytes,
                                           .detail = wire::FromWire(request.detail()),
                                           .deadband = *deadband},
                            .detail = wire::FromWire(request.detail())};
}

}  // namespace taclink::server

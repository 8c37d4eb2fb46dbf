#include "server/rpc/tactile_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/rpc/arm_message.h"
#include "server/rpc/status.h"
#include "wire/convert.h"

namespace taclink::server {
namespace {

using StreamReactor = grpc::ServerWriteReactor<grpc::ByteBuffer>;

/// A call that is refused before it began.
class RefusedStream final : public StreamReactor {
 public:
  explicit RefusedStream(const Error& error) { Finish(ToGrpc(error)); }

 private:
  void OnDone() override { delete this; }
};

StreamReactor* Refuse(const grpc::CallbackServerContext& context, const Error& error) {
  spdlog::info("{}: StreamFrames refused: {}", context.peer(), error.message);
  return new RefusedStream(error);  // deletes itself when gRPC is done with it
}

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

}  // namespace

TactileService::TactileService(Arm& arm, ServiceLimits limits,
                               std::shared_ptr<boost::asio::thread_pool> senders)
    : arm_(arm), limits_(limits), senders_(std::move(senders)), registry_(limits.max_streams) {
  for (const LinkDescription& link : arm.links()) link_names_.push_back(link.name);
}

grpc::ServerUnaryReactor* TactileService::GetArm(grpc::CallbackServerContext* context,
                                                 const v1::GetArmRequest*, v1::GetArmResponse* response) {
  Fill(arm_, *response->mutable_arm());
  auto* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

StreamReactor* TactileService::StreamFrames(grpc::CallbackServerContext* context,
                                            const grpc::ByteBuffer* request) {
  auto options = ParseRequest(*request);
  if (!options) return Refuse(*context, options.error());
  auto stream = std::make_shared<FrameStream>(std::move(*options), link_names_, registry_, senders_);
  switch (registry_.Add(stream)) {
    case StreamRegistry::Added::kYes:
      break;
    case StreamRegistry::Added::kFull:
      return Refuse(*context, {ErrorCode::kResourceExhausted,
                               "all " + std::to_string(limits_.max_streams) +
                                   " streams are in use; close one or raise limits.max_streams"});
    case StreamRegistry::Added::kClosed:
      return Refuse(*context, {ErrorCode::kUnavailable, "server is shutting down"});
  }
  stream->Begin(arm_.hub());
  return stream.get();  // the registry holds it until gRPC is done
}

Result<std::vector<bool>> TactileService::FindLinks(const v1::StreamFramesRequest& request) const {
  std::vector<bool> wanted;
  if (request.links().empty()) return wanted;
  wanted.assign(link_names_.size(), false);
  for (const std::string& name : request.links()) {
    const auto at = std::find(link_names_.begin(), link_names_.end(), name);
    if (at == link_names_.end()) {
      std::string known;
      for (const auto& link : link_names_) known += (known.empty() ? "" : ", ") + link;
      return Error{ErrorCode::kNotFound, "no link '" + name + "'; this arm has " + known};
    }
    wanted[static_cast<size_t>(at - link_names_.begin())] = true;
  }
  return wanted;
}

Result<FrameStreamOptions> TactileService::ParseRequest(const grpc::ByteBuffer& bytes) const {
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
  auto links = FindLinks(request);
  if (!links) return links.error();
  const bool every = request.delivery() == v1::DELIVERY_EVERY;
  return FrameStreamOptions{.subscriber = {.links = std::move(*links),
                                           .delivery = every ? Delivery::kEvery : Delivery::kLatest,
                                           .max_rate_hz = request.max_rate_hz(),
                                           .queue_capacity = limits_.queue_messages},
                            .detail = wire::FromWire(request.detail())};
}

}  // namespace taclink::server

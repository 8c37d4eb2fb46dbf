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

constexpr uint32_t kDefaultPairs = 8, kMaxPairs = 300;

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
    : arm_(arm),
      limits_(limits),
      senders_(std::move(senders)),
      registry_(limits.max_streams),
      calibrations_(arm.links().size()) {
  for (const LinkDescription& link : arm.links()) link_names_.push_back(link.name);
}

void TactileService::EndStreams(const std::string& reason) {
  registry_.Close(reason);
  const std::lock_guard lock(calibrations_mutex_);
  for (const auto& calibration : calibrations_) {
    if (const auto stream = calibration.lock()) stream->Refuse({ErrorCode::kUnavailable, reason});
  }
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

grpc::ServerWriteReactor<v1::CalibrateResponse>* TactileService::Calibrate(
    grpc::CallbackServerContext* context, const v1::CalibrateRequest* request) {
  const auto stream = CalibrateStream::Make();
  const uint32_t pairs = request->pairs() == 0 ? kDefaultPairs : request->pairs();
  const auto link = FindLink(request->link());
  Result<void> ordered;
  if (!link) {
    ordered = link.error();
  } else if (pairs > kMaxPairs) {
    ordered = Invalid("pairs must be 1 to " + std::to_string(kMaxPairs) + ", or 0 for " +
                      std::to_string(kDefaultPairs));
  } else {
    ordered = arm_.worker(*link).Calibrate(
        {.pairs = static_cast<int>(pairs), .save = request->save(), .force = request->force()},
        [stream](const CalibrationProgress& progress) { return stream->Tell(progress); });
  }
  if (!ordered) {
    spdlog::info("{}: Calibrate refused: {}", context->peer(), ordered.error().message);
    stream->Refuse(ordered.error());
  } else {
    const std::lock_guard lock(calibrations_mutex_);
    calibrations_[*link] = stream;
  }
  return stream.get();  // holds itself until gRPC is done
}

Result<size_t> TactileService::FindLink(const std::string& name) const {
  const auto at = std::find(link_names_.begin(), link_names_.end(), name);
  if (at != link_names_.end()) return static_cast<size_t>(at - link_names_.begin());
  std::string known;
  for (const auto& link : link_names_) known += (known.empty() ? "" : ", ") + link;
  return Error{ErrorCode::kNotFound, "no link '" + name + "'; this arm has " + known};
}

Result<std::vector<bool>> TactileService::FindLinks(const v1::StreamFramesRequest& request) const {
  std::vector<bool> wanted;
  if (request.links().empty()) return wanted;
  wanted.assign(link_names_.size(), false);
  for (const std::string& name : request.links()) {
    const auto link = FindLink(name);
    if (!link) return link.error();
    wanted[*link] = true;
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

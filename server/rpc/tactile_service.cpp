#include "server/rpc/tactile_service.h"

#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <utility>

#include "server/link_names.h"
#include "server/rpc/arm_message.h"
#include "server/rpc/event_calls.h"
#include "server/rpc/link_calls.h"
#include "server/rpc/preview_stream.h"
#include "server/rpc/refused_stream.h"
#include "server/rpc/status.h"
#include "server/rpc/stream_request.h"
#include "server/rpc/who.h"

namespace taclink::server {
namespace {

// A robot has one source of joint states, a few at most.
constexpr size_t kMaxUpdateCalls = 16;
constexpr uint32_t kDefaultPairs = 8, kMaxPairs = 300, kDefaultTareFrames = 10;

using StreamReactor = grpc::ServerWriteReactor<grpc::ByteBuffer>;

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

std::string CountRange(const char* field, uint32_t unset) {
  return std::string(field) + " must be 1 to " + std::to_string(kMaxPairs) + ", or 0 for " +
         std::to_string(unset);
}

}  // namespace

TactileService::TactileService(Arm& arm, ServiceLimits limits,
                               std::shared_ptr<boost::asio::thread_pool> senders,
                               std::shared_ptr<const Security> security)
    : arm_(arm),
      senders_(std::move(senders)),
      security_(std::move(security)),
      registry_(limits.max_streams, limits.max_streams_per_peer),
      updates_(kMaxUpdateCalls),
      limits_(limits) {
  link_names_ = arm.link_names();
}

void TactileService::EndStreams(const std::string& reason) {
  registry_.Close(reason);
  updates_.Close(reason);
  calibrations_.Close(reason);
  tares_.Close(reason);
  for (size_t link = 0; link < link_names_.size(); ++link)
    arm_.worker(link).EndCameraOrders({ErrorCode::kUnavailable, reason});
}

ServiceLimits TactileService::limits() const {
  const std::lock_guard lock(limits_mutex_);
  return limits_;
}

void TactileService::SetLimits(ServiceLimits limits) {
  registry_.SetMaxStreams(limits.max_streams, limits.max_streams_per_peer);
  const std::lock_guard lock(limits_mutex_);
  limits_ = limits;
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
  auto options = ParseStreamRequest(*request, link_names_, limits());
  if (!options) return RefuseStream(*context, "StreamFrames", options.error());
  auto stream = std::make_shared<FrameStream>(std::move(*options), link_names_, registry_, senders_);
  if (auto* refused = AddOrRefuse(*context, "StreamFrames", stream)) return refused;
  stream->Begin(arm_.hub());
  return stream.get();  // the registry holds it until gRPC is done
}

StreamReactor* TactileService::StreamContacts(grpc::CallbackServerContext* context,
                                              const grpc::ByteBuffer* request) {
  const auto max_rate_hz = ContactStream::ParseRequest(*request);
  if (!max_rate_hz) return RefuseStream(*context, "StreamContacts", max_rate_hz.error());
  auto stream = std::make_shared<ContactStream>(arm_, *max_rate_hz, registry_, senders_);
  if (auto* refused = AddOrRefuse(*context, "StreamContacts", stream)) return refused;
  stream->Begin();
  return stream.get();  // the registry holds it until gRPC is done
}

StreamReactor* TactileService::StreamEvents(grpc::CallbackServerContext* context,
                                            const grpc::ByteBuffer* bytes) {
  constexpr const char* kCall = "StreamEvents";
  v1::StreamEventsRequest request;
  grpc::ByteBuffer copy(*bytes);  // parsing empties it
  if (!grpc::SerializationTraits<v1::StreamEventsRequest>::Deserialize(&copy, &request).ok())
    return RefuseStream(*context, kCall, Invalid("the request is no StreamEventsRequest message"));
  const auto links = FindLinks(link_names_, request.links());
  if (!links) return RefuseStream(*context, kCall, links.error());
  const auto options = server::ParseRequest(request, *links, arm_.events().history());
  if (!options) return RefuseStream(*context, kCall, options.error());
  auto stream = std::make_shared<EventStream>(link_names_, arm_.clock(), registry_, senders_);
  if (auto* refused = AddOrRefuse(*context, kCall, stream)) return refused;
  stream->Begin(arm_.events().history(), options->start, options->filter);
  return stream.get();
}

StreamReactor* TactileService::AddOrRefuse(const grpc::CallbackServerContext& context, const char* method,
                                           std::shared_ptr<PumpedStream> stream) {
  const auto admitted = registry_.Admit(std::move(stream), PeerOf(context));
  return admitted ? nullptr : RefuseStream(context, method, admitted.error());
}

grpc::ServerReadReactor<v1::UpdateJointStatesRequest>* TactileService::UpdateJointStates(
    grpc::CallbackServerContext*, v1::UpdateJointStatesResponse* response) {
  return TakeJointStates(arm_, updates_, *response);
}

grpc::ServerReadReactor<v1::UpdatePressureRequest>* TactileService::UpdatePressure(
    grpc::CallbackServerContext*, v1::UpdatePressureResponse* response) {
  return TakePressure(arm_, updates_, *response);
}

grpc::ServerUnaryReactor* TactileService::SetThresholds(grpc::CallbackServerContext* context,
                                                        const v1::SetThresholdsRequest* request,
                                                        v1::SetThresholdsResponse* response) {
  const auto link = arm_.FindLink(request->link());
  const Result<void> set =
      link ? server::SetThresholds(arm_, *link, *request, Who(*context, *security_), *response)
           : link.error();
  if (!set) spdlog::info("{}: SetThresholds refused: {}", PeerOf(*context), set.error().message);
  auto* reactor = context->DefaultReactor();
  reactor->Finish(set ? grpc::Status::OK : ToGrpc(set.error()));
  return reactor;
}

StreamReactor* TactileService::StreamPreview(grpc::CallbackServerContext* context,
                                             const grpc::ByteBuffer* request) {
  const auto options = ParsePreviewRequest(*request, link_names_);
  if (!options) return RefuseStream(*context, "StreamPreview", options.error());
  const std::string& link = link_names_[options->link];
  if (const auto live = FindLiveLink(arm_, link); !live)
    return RefuseStream(*context, "StreamPreview", live.error());
  auto stream = std::make_shared<PreviewStream>(*options, link, registry_, aside_);
  if (auto* refused = AddOrRefuse(*context, "StreamPreview", stream)) return refused;
  stream->Begin(arm_.hub());
  return stream.get();  // the registry holds it until gRPC is done
}

grpc::ServerUnaryReactor* TactileService::SetForceModel(grpc::CallbackServerContext* context,
                                                        const v1::SetForceModelRequest* request,
                                                        v1::SetForceModelResponse*) {
  grpc::ServerUnaryReactor* const reactor = context->DefaultReactor();
  const auto link = FindLiveLink(arm_, request->link());
  const auto model = ParseForceModel(*request);
  if (!link || !model) {
    reactor->Finish(ToGrpc(link ? model.error() : link.error()));
    return reactor;
  }
  boost::asio::post(*aside_, [this, reactor, link = *link, model = *model, who = Who(*context, *security_)] {
    const Result<void> set = arm_.worker(link).SetForceModel(model);
    arm_.events().Post(EventKind::kForceModel, link, ToOperation(model, set, who));
    reactor->Finish(set ? grpc::Status::OK : ToGrpc(set.error()));
  });
  return reactor;
}

grpc::ServerUnaryReactor* TactileService::SetCamera(grpc::CallbackServerContext* context,
                                                    const v1::SetCameraRequest* request,
                                                    v1::SetCameraResponse*) {
  grpc::ServerUnaryReactor* const reactor = context->DefaultReactor();
  const auto link = FindLiveLink(arm_, request->link());
  const auto order = ParseCameraRequest(*request);
  if (!link || !order) {
    reactor->Finish(ToGrpc(link ? order.error() : link.error()));
    return reactor;
  }
  const auto observer = [reactor, request, &arm = arm_, link = *link,
                         who = Who(*context, *security_)](const Result<void>& end) {
    arm.events().Post(EventKind::kCamera, link, ToOperation(*request, end, who));
    reactor->Finish(end ? grpc::Status::OK : ToGrpc(end.error()));
  };
  if (const auto ordered = arm_.worker(*link).SetCamera(*order, observer); !ordered)
    observer(ordered.error());
  return reactor;
}

Result<void> TactileService::OrderCalibration(const std::string& who, const v1::CalibrateRequest& request,
                                              const std::shared_ptr<CalibrateStream>& stream) {
  const uint32_t pairs = request.pairs() == 0 ? kDefaultPairs : request.pairs();
  const auto link = arm_.FindLink(request.link());
  if (!link) return link.error();
  if (pairs > kMaxPairs) return Invalid(CountRange("pairs", kDefaultPairs));
  return arm_.worker(*link).Calibrate(
      {.pairs = static_cast<int>(pairs), .save = request.save(), .force = request.force()},
      [stream, &arm = arm_, at = *link, who](const CalibrationProgress& progress) {
        if (progress.end) arm.events().Post(EventKind::kCalibration, at, ToOperation(*progress.end, who));
        return stream->Tell(progress);
      });
}

grpc::ServerWriteReactor<v1::CalibrateResponse>* TactileService::Calibrate(
    grpc::CallbackServerContext* context, const v1::CalibrateRequest* request) {
  const auto stream = CalibrateStream::Make();
  Result<void> ordered = calibrations_.Add(stream);
  if (ordered) ordered = OrderCalibration(Who(*context, *security_), *request, stream);
  if (!ordered) {
    spdlog::info("{}: Calibrate refused: {}", PeerOf(*context), ordered.error().message);
    stream->End(ordered.error());
  }
  return stream.get();  // holds itself until gRPC is done
}

grpc::ServerUnaryReactor* TactileService::Tare(grpc::CallbackServerContext* context,
                                               const v1::TareRequest* request, v1::TareResponse* response) {
  grpc::ServerUnaryReactor* const reactor = context->DefaultReactor();
  const auto wanted = FindLinks(link_names_, request->links());
  const uint32_t frames = request->frames() == 0 ? kDefaultTareFrames : request->frames();
  if (!wanted || frames > kMaxPairs) {
    const Error error = !wanted ? wanted.error() : Invalid(CountRange("frames", kDefaultTareFrames));
    spdlog::info("{}: Tare refused: {}", PeerOf(*context), error.message);
    reactor->Finish(ToGrpc(error));
    return reactor;
  }
  std::vector<size_t> links;
  std::vector<std::string> names;
  for (size_t link = 0; link < link_names_.size(); ++link) {
    if (!wanted->empty() && !(*wanted)[link]) continue;
    links.push_back(link);
    names.push_back(link_names_[link]);
  }
  const auto call = std::make_shared<TareCall>(names, response, reactor);
  if (const auto added = tares_.Add(call); !added) {
    call->End(added.error());
    return reactor;
  }
  const TareOptions options{.frames = static_cast<int>(frames), .force = request->force()};
  for (size_t place = 0; place < links.size(); ++place) {
    const auto observer = [call, place, &arm = arm_, link = links[place], name = names[place],
                           who = Who(*context, *security_)](const Result<TareSummary>& end) {
      spdlog::info("{}: tare of link {}: {}", who, name, end ? "done" : end.error().message);
      arm.events().Post(EventKind::kTare, link, ToOperation(end, who));
      call->Answer(place, end);
    };
    const auto ordered = arm_.worker(links[place]).Tare(options, observer);
    if (!ordered) observer(ordered.error());
  }
  return reactor;
}

}  // namespace taclink::server

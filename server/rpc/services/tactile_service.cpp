#include "server/rpc/services/tactile_service.h"

#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <utility>

#include "server/arm/link_names.h"
#include "server/messages/arm_message.h"
#include "server/messages/history_message.h"
#include "server/rpc/requests/refusal.h"
#include "server/rpc/requests/request_check.h"
#include "server/rpc/requests/status.h"
#include "server/rpc/requests/who.h"
#include "server/rpc/services/event_calls.h"
#include "server/rpc/services/link_calls.h"
#include "server/rpc/streams/preview_stream.h"
#include "server/rpc/streams/stream_request.h"

namespace taclink::server {
namespace {

// A robot has one source of joint states, a few at most.
constexpr ShareLimits kUpdateCalls = {.all = 16, .per_party = 8};
constexpr uint32_t kDefaultPairs = 8, kDefaultTareFrames = 10;

using StreamReactor = grpc::ServerWriteReactor<grpc::ByteBuffer>;

StreamLimits ToStreamLimits(const ServiceLimits& limits) {
  return {.streams = {.all = limits.max_streams, .per_party = limits.max_streams_per_peer},
          .queue_bytes_per_party = limits.queue_bytes_per_peer};
}

}  // namespace

TactileService::TactileService(Arm& arm, ServiceLimits limits,
                               std::shared_ptr<boost::asio::thread_pool> senders,
                               std::shared_ptr<const Security> security)
    : arm_(arm),
      senders_(std::move(senders)),
      security_(std::move(security)),
      registry_(ToStreamLimits(limits)),
      updates_(kUpdateCalls),
      limits_(limits) {
  link_names_ = arm.link_names();
}

void TactileService::EndStreams(const std::string& reason) {
  registry_.Close(reason);
  updates_.Close(reason);
  calibrations_.Close(reason);
  tares_.Close(reason);
  for (size_t link = 0; link < link_names_.size(); ++link)
    arm_.worker(link).CloseCommands({ErrorCode::kUnavailable, reason});
}

ServiceLimits TactileService::limits() const {
  const std::lock_guard lock(limits_mutex_);
  return limits_;
}

void TactileService::SetLimits(ServiceLimits limits) {
  registry_.SetLimits(ToStreamLimits(limits));
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

grpc::ServerUnaryReactor* TactileService::GetForceHistory(grpc::CallbackServerContext* context,
                                                          const v1::GetForceHistoryRequest* request,
                                                          v1::GetForceHistoryResponse* response) {
  constexpr const char* kCall = "GetForceHistory";
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, kCall, good.error());
  const auto links = FindLinks(link_names_, request->links());
  if (!links) return RefuseCall(*context, kCall, links.error());
  Fill(arm_, *links, request->span_s(), *response);
  auto* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

StreamReactor* TactileService::StreamFrames(grpc::CallbackServerContext* context,
                                            const grpc::ByteBuffer* request) {
  auto options = ParseStreamRequest(*request, link_names_, limits());
  if (!options) return RefuseStream(*context, "StreamFrames", options.error());
  auto stream =
      std::make_shared<FrameStream>(std::move(*options), link_names_, arm_.clock(), registry_, senders_);
  if (auto* refused = AddOrRefuse(*context, "StreamFrames", stream)) return refused;
  stream->Begin(arm_.hub());
  return stream.get();  // the registry holds it until gRPC is done
}

StreamReactor* TactileService::StreamContacts(grpc::CallbackServerContext* context,
                                              const grpc::ByteBuffer* request) {
  const auto parsed = ParseRequest<v1::StreamContactsRequest>(*request);
  if (!parsed) return RefuseStream(*context, "StreamContacts", parsed.error());
  auto stream = std::make_shared<ContactStream>(arm_, parsed->max_rate_hz(), registry_, senders_);
  if (auto* refused = AddOrRefuse(*context, "StreamContacts", stream)) return refused;
  stream->Begin();
  return stream.get();  // the registry holds it until gRPC is done
}

StreamReactor* TactileService::StreamEvents(grpc::CallbackServerContext* context,
                                            const grpc::ByteBuffer* bytes) {
  constexpr const char* kCall = "StreamEvents";
  const auto request = ParseRequest<v1::StreamEventsRequest>(*bytes);
  if (!request) return RefuseStream(*context, kCall, request.error());
  const auto links = FindLinks(link_names_, request->links());
  if (!links) return RefuseStream(*context, kCall, links.error());
  const auto options = ToEventStreamOptions(*request, *links, arm_.events().history());
  if (!options) return RefuseStream(*context, kCall, options.error());
  auto stream = std::make_shared<EventStream>(link_names_, arm_.clock(), registry_, senders_);
  if (auto* refused = AddOrRefuse(*context, kCall, stream)) return refused;
  stream->Begin(arm_.events().history(), options->start, options->filter);
  return stream.get();
}

StreamReactor* TactileService::AddOrRefuse(const grpc::CallbackServerContext& context, const char* method,
                                           std::shared_ptr<PumpedStream> stream) {
  const auto admitted = registry_.Admit(std::move(stream), PartyOf(context, *security_), context.peer());
  return admitted ? nullptr : RefuseStream(context, method, admitted.error());
}

grpc::ServerReadReactor<grpc::ByteBuffer>* TactileService::UpdateJointStates(
    grpc::CallbackServerContext* context, grpc::ByteBuffer* response) {
  return TakeJointStates(arm_, updates_, PartyOf(*context, *security_), *response);
}

grpc::ServerReadReactor<grpc::ByteBuffer>* TactileService::UpdatePressure(
    grpc::CallbackServerContext* context, grpc::ByteBuffer* response) {
  return TakePressure(arm_, updates_, PartyOf(*context, *security_), *response);
}

grpc::ServerReadReactor<grpc::ByteBuffer>* TactileService::UpdateAttitude(
    grpc::CallbackServerContext* context, grpc::ByteBuffer* response) {
  return TakeAttitude(arm_, updates_, PartyOf(*context, *security_), *response);
}

grpc::ServerUnaryReactor* TactileService::SetThresholds(grpc::CallbackServerContext* context,
                                                        const v1::SetThresholdsRequest* request,
                                                        v1::SetThresholdsResponse* response) {
  constexpr const char* kCall = "SetThresholds";
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, kCall, good.error());
  const auto link = arm_.FindLink(request->link());
  if (!link) return RefuseCall(*context, kCall, link.error());
  const auto set = server::SetThresholds(arm_, *link, *request, Who(*context, *security_), *response);
  if (!set) return RefuseCall(*context, kCall, set.error());
  auto* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
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
  constexpr const char* kCall = "SetForceModel";
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, kCall, good.error());
  const auto link = FindLiveLink(arm_, request->link());
  if (!link) return RefuseCall(*context, kCall, link.error());
  const auto model = ParseForceModel(*request);
  if (!model) return RefuseCall(*context, kCall, model.error());
  grpc::ServerUnaryReactor* const reactor = context->DefaultReactor();
  boost::asio::post(*aside_, [this, reactor, link = *link, model = *model, who = Who(*context, *security_)] {
    const auto observer = [reactor, &arm = arm_, link, model, who](const Result<void>& end) {
      arm.events().Post(EventKind::kForceModel, link, ToOperation(model, end, who));
      reactor->Finish(end ? grpc::Status::OK : ToGrpc(end.error()));
    };
    if (const auto posted = arm_.worker(link).SetForceModel(model, observer); !posted)
      observer(posted.error());
  });
  return reactor;
}

grpc::ServerUnaryReactor* TactileService::SetCamera(grpc::CallbackServerContext* context,
                                                    const v1::SetCameraRequest* request,
                                                    v1::SetCameraResponse*) {
  constexpr const char* kCall = "SetCamera";
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, kCall, good.error());
  const auto link = FindLiveLink(arm_, request->link());
  if (!link) return RefuseCall(*context, kCall, link.error());
  const auto order = ParseCameraRequest(*request);
  if (!order) return RefuseCall(*context, kCall, order.error());
  grpc::ServerUnaryReactor* const reactor = context->DefaultReactor();
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
  if (auto good = CheckRequest(request); !good) return good;
  const uint32_t pairs = request.pairs() == 0 ? kDefaultPairs : request.pairs();
  const auto link = arm_.FindLink(request.link());
  if (!link) return link.error();
  return arm_.worker(*link).Calibrate(
      {.pairs = static_cast<int>(pairs),
       .repeats = static_cast<int>(std::max(1U, request.repeats())),
       .save = request.save(),
       .force = request.force()},
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
    SPDLOG_INFO("{}: Calibrate refused: {}", PeerOf(*context), ordered.error().message);
    stream->End(ordered.error());
  }
  return stream.get();  // holds itself until gRPC is done
}

grpc::ServerUnaryReactor* TactileService::Tare(grpc::CallbackServerContext* context,
                                               const v1::TareRequest* request, v1::TareResponse* response) {
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, "Tare", good.error());
  const auto wanted = FindLinks(link_names_, request->links());
  if (!wanted) return RefuseCall(*context, "Tare", wanted.error());
  const uint32_t frames = request->frames() == 0 ? kDefaultTareFrames : request->frames();
  grpc::ServerUnaryReactor* const reactor = context->DefaultReactor();
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
  const TareOptions options{
      .frames = static_cast<int>(frames), .force = request->force(), .undo = request->undo()};
  for (size_t place = 0; place < links.size(); ++place) {
    const auto observer = [call, place, &arm = arm_, link = links[place], name = names[place],
                           who = Who(*context, *security_)](const Result<TareSummary>& end) {
      SPDLOG_INFO("{}: tare of link {}: {}", who, name,
                  !end          ? end.error().message
                  : end->undone ? "undone"
                                : "done");
      arm.events().Post(EventKind::kTare, link, ToOperation(end, who));
      call->Answer(place, end);
    };
    const auto ordered = arm_.worker(links[place]).Tare(options, observer);
    if (!ordered) observer(ordered.error());
  }
  return reactor;
}

}  // namespace taclink::server

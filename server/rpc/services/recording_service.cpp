#include "server/rpc/services/recording_service.h"

#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <exception>
#include <functional>
#include <string>
#include <utility>

#include "server/process/system_limits.h"
#include "server/replay/log_pictures.h"
#include "server/rpc/requests/refusal.h"
#include "server/rpc/requests/request_check.h"
#include "server/rpc/requests/status.h"
#include "server/rpc/requests/who.h"
#include "server/rpc/streams/download_stream.h"
#include "server/rpc/streams/replay_stream.h"

namespace taclink::server {
namespace {

constexpr size_t kPlayerThreads = 2;  // a large chunk that one player reads does not make all others late

// Damage is no fault of the caller's.
grpc::Status OfLog(const Error& error) {
  const bool damaged = error.code == ErrorCode::kInvalidArgument;
  return damaged ? grpc::Status(grpc::StatusCode::DATA_LOSS, error.message) : ToGrpc(error);
}

OpenedLog OpenLog(Recorder& recorder, const std::string& name) {
  if (const auto found = recorder.folder().Find(name); !found)
    return {.reader = nullptr, .status = ToGrpc(found.error())};
  auto reader = recorder.catalog().Open(name);
  if (reader) return {.reader = std::move(*reader), .status = grpc::Status::OK};
  return {.reader = nullptr, .status = OfLog(reader.error())};
}

// What work throws ends its call, not the pool's thread and the server with it.
grpc::Status Guarded(const std::function<grpc::Status()>& work) {
  try {
    return work();
  } catch (const std::exception& e) {
    return {grpc::StatusCode::INTERNAL, DescribeLimit(e)};
  }
}

}  // namespace

RecordingService::RecordingService(Recorder& recorder, StreamRegistry& registry,
                                   std::shared_ptr<boost::asio::thread_pool> senders,
                                   std::shared_ptr<const Security> security)
    : recorder_(recorder),
      registry_(registry),
      senders_(std::move(senders)),
      players_(std::make_shared<boost::asio::thread_pool>(kPlayerThreads)),
      desk_(std::make_shared<ReplayDesk>()),
      security_(std::move(security)) {}

grpc::ServerUnaryReactor* RecordingService::Later(CallQueue& queue, grpc::CallbackServerContext* context,
                                                  const char* method, std::function<grpc::Status()> work) {
  auto* reactor = context->DefaultReactor();
  const auto answer = [reactor, method, peer = PeerOf(*context), work = std::move(work)] {
    const grpc::Status done = Guarded(work);
    if (!done.ok()) SPDLOG_INFO("{}: {} refused: {}", peer, method, done.error_message());
    reactor->Finish(done);
  };
  const auto posted = queue.Post(PartyOf(*context, *security_), answer);
  return posted ? reactor : RefuseCall(*context, method, posted.error());
}

grpc::ServerUnaryReactor* RecordingService::StartRecording(grpc::CallbackServerContext* context,
                                                           const v1::StartRecordingRequest* request,
                                                           v1::StartRecordingResponse* response) {
  if (const auto good = CheckRequest(*request); !good)
    return RefuseCall(*context, "StartRecording", good.error());
  const auto work = [this, request, response, who = Who(*context, *security_)]() -> grpc::Status {
    auto status = recorder_.Start(*request, who);
    if (!status) return ToGrpc(status.error());
    *response->mutable_status() = std::move(*status);
    return grpc::Status::OK;
  };
  return Later(orders_, context, "StartRecording", work);
}

grpc::ServerUnaryReactor* RecordingService::StopRecording(grpc::CallbackServerContext* context,
                                                          const v1::StopRecordingRequest*,
                                                          v1::StopRecordingResponse* response) {
  const auto work = [this, response, who = Who(*context, *security_)]() -> grpc::Status {
    auto status = recorder_.Stop(who);
    if (!status) return ToGrpc(status.error());
    *response->mutable_status() = std::move(*status);
    return grpc::Status::OK;
  };
  return Later(orders_, context, "StopRecording", work);
}

grpc::ServerUnaryReactor* RecordingService::GetRecorder(grpc::CallbackServerContext* context,
                                                        const v1::GetRecorderRequest*,
                                                        v1::GetRecorderResponse* response) {
  return Later(orders_, context, "GetRecorder", [this, response] {
    *response->mutable_status() = recorder_.Status();
    return grpc::Status::OK;
  });
}

grpc::ServerUnaryReactor* RecordingService::ListLogs(grpc::CallbackServerContext* context,
                                                     const v1::ListLogsRequest*,
                                                     v1::ListLogsResponse* response) {
  return Later(reading_, context, "ListLogs", [this, response] {
    for (v1::Log& log : recorder_.catalog().List()) *response->add_logs() = std::move(log);
    return grpc::Status::OK;
  });
}

grpc::ServerUnaryReactor* RecordingService::DescribeLog(grpc::CallbackServerContext* context,
                                                        const v1::DescribeLogRequest* request,
                                                        v1::DescribeLogResponse* response) {
  if (const auto good = CheckRequest(*request); !good)
    return RefuseCall(*context, "DescribeLog", good.error());
  return Later(reading_, context, "DescribeLog", [this, request, response] {
    auto described = recorder_.catalog().Describe(request->log());
    if (!described) return ToGrpc(described.error());
    *response = std::move(*described);
    return grpc::Status::OK;
  });
}

grpc::ServerUnaryReactor* RecordingService::DeleteLog(grpc::CallbackServerContext* context,
                                                      const v1::DeleteLogRequest* request,
                                                      v1::DeleteLogResponse*) {
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, "DeleteLog", good.error());
  const auto work = [this, request, who = Who(*context, *security_)]() -> grpc::Status {
    const auto deleted = recorder_.folder().Delete(request->log());
    if (!deleted) return ToGrpc(deleted.error());
    SPDLOG_INFO("{}: {} deleted", who, request->log());
    return grpc::Status::OK;
  };
  return Later(reading_, context, "DeleteLog", work);
}

RecordingService::Stream* RecordingService::DownloadLog(grpc::CallbackServerContext* context,
                                                        const grpc::ByteBuffer* bytes) {
  constexpr const char* kCall = "DownloadLog";
  const auto request = ParseRequest<v1::DownloadLogRequest>(*bytes);
  if (!request) return RefuseStream(*context, kCall, request.error());
  const auto found = recorder_.folder().Find(request->log());
  if (!found) return RefuseStream(*context, kCall, found.error());
  auto source = mcap::FileSource::Open(recorder_.folder().PathOf(*found));
  if (!source) return RefuseStream(*context, kCall, source.error());
  if (request->offset() > (*source)->size())
    return RefuseStream(
        *context, kCall,
        {ErrorCode::kEndOfData, "offset " + std::to_string(request->offset()) + " is past the end of " +
                                    request->log() + ", " + std::to_string((*source)->size())});
  auto stream = std::make_shared<DownloadStream>(std::move(*source), request->offset(), registry_, senders_,
                                                 reading_.thread());
  if (const auto admitted = registry_.Admit(stream, PartyOf(*context, *security_), context->peer());
      !admitted)
    return RefuseStream(*context, kCall, admitted.error());
  stream->Begin();
  return stream.get();  // the registry holds it until gRPC is done
}

RecordingService::Stream* RecordingService::Replay(grpc::CallbackServerContext* context,
                                                   const grpc::ByteBuffer* bytes) {
  constexpr const char* kCall = "Replay";
  auto order = ParseReplayRequest(*bytes);
  if (!order) return RefuseStream(*context, kCall, order.error());
  const std::string log = order->log, peer = PeerOf(*context);
  auto stream = std::make_shared<ReplayStream>(std::move(*order), peer, desk_, registry_, senders_, players_);
  if (const auto admitted = registry_.Admit(stream, PartyOf(*context, *security_), context->peer());
      !admitted)
    return RefuseStream(*context, kCall, admitted.error());
  stream->Begin(*reading_.thread(), [this, log] { return OpenLog(recorder_, log); });
  return stream.get();  // the registry holds it until gRPC is done
}

grpc::ServerUnaryReactor* RecordingService::ControlReplay(grpc::CallbackServerContext* context,
                                                          const v1::ControlReplayRequest* request,
                                                          v1::ControlReplayResponse*) {
  if (const auto good = CheckRequest(*request); !good)
    return RefuseCall(*context, "ControlReplay", good.error());
  auto* reactor = context->DefaultReactor();
  if (const auto stream = desk_->Find(request->player())) {
    (*stream)->Control(*request, [reactor](const grpc::Status& status) { reactor->Finish(status); });
  } else {
    reactor->Finish(ToGrpc(stream.error()));
  }
  return reactor;
}

grpc::ServerUnaryReactor* RecordingService::GetReplayPictures(grpc::CallbackServerContext* context,
                                                              const v1::GetReplayPicturesRequest* request,
                                                              v1::GetReplayPicturesResponse* response) {
  if (const auto good = CheckRequest(*request); !good)
    return RefuseCall(*context, "GetReplayPictures", good.error());
  return Later(reading_, context, "GetReplayPictures", [this, request, response] {
    const auto stream = desk_->Find(request->player());
    if (!stream) return ToGrpc(stream.error());
    const auto pictures = FindPictures((*stream)->reader(), request->link(), request->utc_ns());
    if (!pictures) return OfLog(pictures.error());
    response->set_sequence(pictures->sequence);
    response->set_exposure_utc_ns(pictures->exposure_utc_ns);
    for (const CameraId id : kBothCameras)
      preview_.Fill(pictures->images[Index(id)], id, *response->add_pictures());
    return grpc::Status::OK;
  });
}

// A player's timer may be pending, and nobody waits for it any more.
void RecordingService::Join() {
  orders_.Join();
  reading_.Join();
  players_->stop();
  players_->join();
}

}  // namespace taclink::server

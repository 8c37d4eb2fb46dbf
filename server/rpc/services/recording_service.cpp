#include "server/rpc/services/recording_service.h"

#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <exception>
#include <functional>
#include <string>
#include <utility>

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
Result<void> Guarded(const std::function<Result<void>()>& work) {
  try {
    return work();
  } catch (const std::exception& e) {
    return Error{ErrorCode::kInternal, e.what()};
  }
}

}  // namespace

RecordingService::RecordingService(Recorder& recorder, StreamRegistry& registry,
                                   std::shared_ptr<boost::asio::thread_pool> senders,
                                   std::shared_ptr<const Security> security)
    : recorder_(recorder),
      registry_(registry),
      senders_(std::move(senders)),
      files_(std::make_shared<boost::asio::thread_pool>(1)),
      players_(std::make_shared<boost::asio::thread_pool>(kPlayerThreads)),
      desk_(std::make_shared<ReplayDesk>()),
      security_(std::move(security)) {}

grpc::ServerUnaryReactor* RecordingService::Later(grpc::CallbackServerContext* context, const char* method,
                                                  std::function<Result<void>()> work) {
  auto* reactor = context->DefaultReactor();
  boost::asio::post(*files_, [reactor, method, peer = PeerOf(*context), work = std::move(work)] {
    const Result<void> done = Guarded(work);
    if (!done) SPDLOG_INFO("{}: {} refused: {}", peer, method, done.error().message);
    reactor->Finish(done ? grpc::Status::OK : ToGrpc(done.error()));
  });
  return reactor;
}

grpc::ServerUnaryReactor* RecordingService::StartRecording(grpc::CallbackServerContext* context,
                                                           const v1::StartRecordingRequest* request,
                                                           v1::StartRecordingResponse* response) {
  if (const auto good = CheckRequest(*request); !good)
    return RefuseCall(*context, "StartRecording", good.error());
  const auto work = [this, request, response, who = Who(*context, *security_)]() -> Result<void> {
    auto status = recorder_.Start(*request, who);
    if (!status) return status.error();
    *response->mutable_status() = std::move(*status);
    return {};
  };
  return Later(context, "StartRecording", work);
}

grpc::ServerUnaryReactor* RecordingService::StopRecording(grpc::CallbackServerContext* context,
                                                          const v1::StopRecordingRequest*,
                                                          v1::StopRecordingResponse* response) {
  const auto work = [this, response, who = Who(*context, *security_)]() -> Result<void> {
    auto status = recorder_.Stop(who);
    if (!status) return status.error();
    *response->mutable_status() = std::move(*status);
    return {};
  };
  return Later(context, "StopRecording", work);
}

grpc::ServerUnaryReactor* RecordingService::GetRecorder(grpc::CallbackServerContext* context,
                                                        const v1::GetRecorderRequest*,
                                                        v1::GetRecorderResponse* response) {
  return Later(context, "GetRecorder", [this, response]() -> Result<void> {
    *response->mutable_status() = recorder_.Status();
    return {};
  });
}

grpc::ServerUnaryReactor* RecordingService::ListLogs(grpc::CallbackServerContext* context,
                                                     const v1::ListLogsRequest*,
                                                     v1::ListLogsResponse* response) {
  return Later(context, "ListLogs", [this, response]() -> Result<void> {
    for (v1::Log& log : recorder_.catalog().List()) *response->add_logs() = std::move(log);
    return {};
  });
}

grpc::ServerUnaryReactor* RecordingService::DescribeLog(grpc::CallbackServerContext* context,
                                                        const v1::DescribeLogRequest* request,
                                                        v1::DescribeLogResponse* response) {
  if (const auto good = CheckRequest(*request); !good)
    return RefuseCall(*context, "DescribeLog", good.error());
  return Later(context, "DescribeLog", [this, request, response]() -> Result<void> {
    auto described = recorder_.catalog().Describe(request->log());
    if (!described) return described.error();
    *response = std::move(*described);
    return {};
  });
}

grpc::ServerUnaryReactor* RecordingService::DeleteLog(grpc::CallbackServerContext* context,
                                                      const v1::DeleteLogRequest* request,
                                                      v1::DeleteLogResponse*) {
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, "DeleteLog", good.error());
  const auto work = [this, request, who = Who(*context, *security_)]() -> Result<void> {
    const auto deleted = recorder_.folder().Delete(request->log());
    if (deleted) SPDLOG_INFO("{}: {} deleted", who, request->log());
    return deleted;
  };
  return Later(context, "DeleteLog", work);
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
  auto stream =
      std::make_shared<DownloadStream>(std::move(*source), request->offset(), registry_, senders_, files_);
  if (const auto admitted = registry_.Admit(stream, PartyOf(*context, *security_)); !admitted)
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
  if (const auto admitted = registry_.Admit(stream, PartyOf(*context, *security_)); !admitted)
    return RefuseStream(*context, kCall, admitted.error());
  stream->Begin(*files_, [this, log] { return OpenLog(recorder_, log); });
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
  auto* reactor = context->DefaultReactor();
  boost::asio::post(*files_, [this, reactor, request, response] {
    const auto stream = desk_->Find(request->player());
    if (!stream) return reactor->Finish(ToGrpc(stream.error()));
    const auto pictures = FindPictures((*stream)->reader(), request->link(), request->utc_ns());
    if (!pictures) return reactor->Finish(OfLog(pictures.error()));
    response->set_sequence(pictures->sequence);
    response->set_exposure_utc_ns(pictures->exposure_utc_ns);
    for (const CameraId id : kBothCameras)
      preview_.Fill(pictures->images[Index(id)], id, *response->add_pictures());
    reactor->Finish(grpc::Status::OK);
  });
  return reactor;
}

// A player's timer may be pending, and nobody waits for it any more.
void RecordingService::Join() {
  files_->join();
  players_->stop();
  players_->join();
}

}  // namespace taclink::server

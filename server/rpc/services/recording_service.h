#pragma once

#include <boost/asio/thread_pool.hpp>
#include <functional>
#include <memory>

#include "server/recording/recorder.h"
#include "server/rpc/services/call_queue.h"
#include "server/rpc/streams/preview_message.h"
#include "server/rpc/streams/replay_desk.h"
#include "server/rpc/streams/stream_registry.h"
#include "server/security/security.h"
#include "taclink/v1/recording.grpc.pb.h"

namespace taclink::server {

/// taclink.v1.RecordingService over the server's recorder, which must outlive it. What waits for the disk is
/// done by threads of its own.
class RecordingService final
    : public v1::RecordingService::WithCallbackMethod_StartRecording<
          v1::RecordingService::WithCallbackMethod_StopRecording<
              v1::RecordingService::WithCallbackMethod_GetRecorder<
                  v1::RecordingService::WithCallbackMethod_ListLogs<
                      v1::RecordingService::WithCallbackMethod_DescribeLog<
                          v1::RecordingService::WithRawCallbackMethod_DownloadLog<
                              v1::RecordingService::WithCallbackMethod_DeleteLog<
                                  v1::RecordingService::WithRawCallbackMethod_Replay<
                                      v1::RecordingService::WithCallbackMethod_ControlReplay<
                                          v1::RecordingService::WithCallbackMethod_GetReplayPictures<
                                              v1::RecordingService::Service>>>>>>>>>> {
 public:
  /// `registry`: of all streams of the server.
  RecordingService(Recorder& recorder, StreamRegistry& registry,
                   std::shared_ptr<boost::asio::thread_pool> senders,
                   std::shared_ptr<const Security> security);

  /// What was asked for is done first. Only once all calls have ended.
  void Join();

  const Recorder& recorder() const { return recorder_; }

 private:
  using Unary = grpc::ServerUnaryReactor;
  using Stream = grpc::ServerWriteReactor<grpc::ByteBuffer>;

  Unary* StartRecording(grpc::CallbackServerContext* context, const v1::StartRecordingRequest* request,
                        v1::StartRecordingResponse* response) override;
  Unary* StopRecording(grpc::CallbackServerContext* context, const v1::StopRecordingRequest* request,
                       v1::StopRecordingResponse* response) override;
  Unary* GetRecorder(grpc::CallbackServerContext* context, const v1::GetRecorderRequest* request,
                     v1::GetRecorderResponse* response) override;
  Unary* ListLogs(grpc::CallbackServerContext* context, const v1::ListLogsRequest* request,
                  v1::ListLogsResponse* response) override;
  Unary* DescribeLog(grpc::CallbackServerContext* context, const v1::DescribeLogRequest* request,
                     v1::DescribeLogResponse* response) override;
  Stream* DownloadLog(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request) override;
  Unary* DeleteLog(grpc::CallbackServerContext* context, const v1::DeleteLogRequest* request,
                   v1::DeleteLogResponse* response) override;
  Stream* Replay(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request) override;
  Unary* ControlReplay(grpc::CallbackServerContext* context, const v1::ControlReplayRequest* request,
                       v1::ControlReplayResponse* response) override;
  Unary* GetReplayPictures(grpc::CallbackServerContext* context, const v1::GetReplayPicturesRequest* request,
                           v1::GetReplayPicturesResponse* response) override;

  /// `work` is done by the queue's thread; the call ends with what it returns.
  Unary* Later(CallQueue& queue, grpc::CallbackServerContext* context, const char* method,
               std::function<grpc::Status()> work);

  // Constant after construction.
  Recorder& recorder_;
  StreamRegistry& registry_;
  const std::shared_ptr<boost::asio::thread_pool> senders_;
  // Two, so that orders to the recorder never wait for logs to be read.
  CallQueue orders_{"waiting calls to the recorder"}, reading_{"waiting calls that read logs"};
  const std::shared_ptr<boost::asio::thread_pool> players_;
  const std::shared_ptr<ReplayDesk> desk_;
  const std::shared_ptr<const Security> security_;
  PreviewMaker preview_;  // used by the thread of reading_
};

}  // namespace taclink::server

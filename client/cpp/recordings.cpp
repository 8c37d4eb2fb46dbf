#include "client/cpp/taclink/recordings.h"

#include <utility>

#include "client/cpp/recordings_connection.h"

namespace taclink::client {
namespace {

using RecordingStub = v1::RecordingService::Stub;

/// The status in an answer of the recorder.
template <typename Response>
Result<v1::RecorderStatus> StatusOf(Result<Response> response) {
  if (!response) return response.error();
  return std::move(*response->mutable_status());
}

}  // namespace

Recordings Client::RecordingCalls() const {
  auto out = std::make_shared<Recordings::Connection>();
  out->address = connection_->address;
  out->channel = connection_->channel;
  out->stub = v1::RecordingService::NewStub(out->channel);
  return Recordings(std::move(out));
}

Result<v1::RecorderStatus> Recordings::Start(const v1::StartRecordingRequest& request) {
  return StatusOf(connection_->Ask(&RecordingStub::StartRecording, request));
}

Result<v1::RecorderStatus> Recordings::Stop() {
  return StatusOf(connection_->Ask(&RecordingStub::StopRecording, v1::StopRecordingRequest()));
}

Result<v1::RecorderStatus> Recordings::Status() {
  return StatusOf(connection_->Ask(&RecordingStub::GetRecorder, v1::GetRecorderRequest()));
}

Result<v1::ListLogsResponse> Recordings::List() {
  return connection_->Ask(&RecordingStub::ListLogs, v1::ListLogsRequest());
}

Result<void> Recordings::Delete(const std::string& log) {
  v1::DeleteLogRequest request;
  request.set_log(log);
  return WithoutValue(connection_->Ask(&RecordingStub::DeleteLog, request));
}

Result<void> Recordings::Download(const std::string& log, uint64_t offset, const LogSink& sink) {
  grpc::ClientContext context;
  v1::DownloadLogRequest request;
  request.set_log(log);
  request.set_offset(offset);
  const auto reader = connection_->stub->DownloadLog(&context, request);
  v1::DownloadLogResponse piece;
  bool wanted = true;
  while (reader->Read(&piece)) {
    wanted = wanted && sink(piece.data(), piece.offset(), piece.size());
    if (!wanted) context.TryCancel();
  }
  const grpc::Status status = reader->Finish();
  if (!wanted) return Error{ErrorCode::kEndOfData, "the download was ended"};
  if (!status.ok()) return FromStatus(status, connection_->address);
  return {};
}

}  // namespace taclink::client

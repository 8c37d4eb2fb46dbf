#include "client/cpp/taclink/recordings.h"

#include "client/cpp/recordings_connection.h"

namespace taclink::client {
namespace {

RecorderState FromMessage(v1::RecorderState state) {
  switch (state) {
    case v1::RECORDER_STATE_IDLE:
      return RecorderState::kIdle;
    case v1::RECORDER_STATE_RECORDING:
      return RecorderState::kRecording;
    case v1::RECORDER_STATE_TROUBLE:
      return RecorderState::kTrouble;
    default:
      return RecorderState::kUnknown;
  }
}

RecorderStatus FromMessage(const v1::RecorderStatus& message) {
  return {.state = FromMessage(message.state()),
          .trouble = message.trouble(),
          .last_trouble = message.last_trouble(),
          .last_trouble_utc_ns = message.last_trouble_utc_ns(),
          .log = message.log(),
          .folder = message.folder(),
          .started_utc_ns = message.started_utc_ns(),
          .synced_utc_ns = message.synced_utc_ns(),
          .bytes = message.bytes(),
          .logs = static_cast<int>(message.logs()),
          .frames = message.frames(),
          .events = message.events(),
          .frames_lost = message.frames_lost(),
          .free_bytes = message.free_bytes(),
          .pictures = message.pictures()};
}

Log FromMessage(const v1::Log& message) {
  return {.name = message.name(),
          .bytes = message.bytes(),
          .start_utc_ns = message.start_utc_ns(),
          .end_utc_ns = message.end_utc_ns(),
          .links = {message.links().begin(), message.links().end()},
          .frames = message.frames(),
          .contacts = message.has_contacts() ? std::optional(message.contacts()) : std::nullopt,
          .pictures = message.pictures(),
          .open = message.open(),
          .problem = message.problem(),
          .note = message.note()};
}

v1::LogCompression ToMessage(LogCompression compression) {
  switch (compression) {
    case LogCompression::kNone:
      return v1::LOG_COMPRESSION_NONE;
    case LogCompression::kZstd:
      return v1::LOG_COMPRESSION_ZSTD;
    case LogCompression::kLz4:
      return v1::LOG_COMPRESSION_LZ4;
    case LogCompression::kAsConfigured:
      break;
  }
  return v1::LOG_COMPRESSION_UNSPECIFIED;
}

}  // namespace

const char* Name(RecorderState state) {
  switch (state) {
    case RecorderState::kIdle:
      return "idle";
    case RecorderState::kRecording:
      return "recording";
    case RecorderState::kTrouble:
      return "trouble";
    case RecorderState::kUnknown:
      break;
  }
  return "unknown";
}

Recordings Client::RecordingCalls() const {
  auto out = std::make_shared<Recordings::Connection>();
  out->address = connection_->address;
  out->channel = connection_->channel;
  out->stub = v1::RecordingService::NewStub(out->channel);
  return Recordings(std::move(out));
}

Result<RecorderStatus> Recordings::Start(const RecordingOptions& options) {
  v1::StartRecordingRequest request;
  request.set_name(options.name);
  for (const std::string& link : options.links) request.add_links(link);
  request.set_pictures(options.pictures);
  request.set_compression(ToMessage(options.compression));
  request.set_note(options.note);
  v1::StartRecordingResponse response;
  const auto done = connection_->Ask(
      [&](auto& context) { return connection_->stub->StartRecording(&context, request, &response); });
  if (!done) return done.error();
  return FromMessage(response.status());
}

Result<RecorderStatus> Recordings::Stop() {
  v1::StopRecordingResponse response;
  const auto done = connection_->Ask(
      [&](auto& context) { return connection_->stub->StopRecording(&context, {}, &response); });
  if (!done) return done.error();
  return FromMessage(response.status());
}

Result<RecorderStatus> Recordings::Status() {
  v1::GetRecorderResponse response;
  const auto done = connection_->Ask(
      [&](auto& context) { return connection_->stub->GetRecorder(&context, {}, &response); });
  if (!done) return done.error();
  return FromMessage(response.status());
}

Result<std::vector<Log>> Recordings::List() {
  v1::ListLogsResponse response;
  const auto done =
      connection_->Ask([&](auto& context) { return connection_->stub->ListLogs(&context, {}, &response); });
  if (!done) return done.error();
  std::vector<Log> logs;
  for (const v1::Log& log : response.logs()) logs.push_back(FromMessage(log));
  return logs;
}

Result<void> Recordings::Delete(const std::string& log) {
  v1::DeleteLogRequest request;
  request.set_log(log);
  v1::DeleteLogResponse response;
  return connection_->Ask(
      [&](auto& context) { return connection_->stub->DeleteLog(&context, request, &response); });
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

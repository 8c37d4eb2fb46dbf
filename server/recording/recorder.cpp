#include "server/recording/recorder.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "sensing/core/name.h"
#include "sensing/core/thread_start.h"
#include "server/arm/link_names.h"

namespace taclink::server {
namespace {

std::optional<mcap::Compression> FromWire(v1::LogCompression compression) {
  switch (compression) {
    case v1::LOG_COMPRESSION_NONE:
      return mcap::Compression::kNone;
    case v1::LOG_COMPRESSION_ZSTD:
      return mcap::Compression::kZstd;
    case v1::LOG_COMPRESSION_LZ4:
      return mcap::Compression::kLz4;
    default:
      return std::nullopt;
  }
}

}  // namespace

Recorder::Recorder(Arm& arm, const RecordingConfig& config, LogPreamble preamble, mcap::FileCalls& calls)
    : arm_(arm),
      config_(config),
      preamble_(std::move(preamble)),
      folder_(config.folder, calls),
      catalog_(folder_) {}

Recorder::~Recorder() {
  Close();
}

void Recorder::Close() {
  const std::lock_guard order(order_mutex_);
  std::shared_ptr<Recording> recording;
  {
    const std::lock_guard lock(mutex_);
    recording = std::exchange(recording_, nullptr);
  }
  if (!recording) return;
  recording->Stop();
  const v1::RecorderStatus status = recording->Status();
  SPDLOG_INFO("recording {} ends with the server: {} frames, {} lost", status.log(), status.frames(),
              status.frames_lost());
}

Result<void> Recorder::CheckFolder() const {
  if (folder_.path().empty())
    return Error{ErrorCode::kFailedPrecondition,
                 "the server has no folder for logs: set recording.folder in its configuration"};
  return folder_.Prepare();
}

void Recorder::Open() {
  if (!config_.at_start && !folder_.Exists()) return;
  if (const auto good = folder_.Prepare(); !good) {
    SPDLOG_ERROR("recording: {}; nothing can be recorded until that is mended", good.error().message);
    return;
  }
  const std::vector<LogFileEntry> unfinished = folder_.Unfinished();
  if (!unfinished.empty()) {
    auto mender = StartThread("log-mender", [unfinished, folder = folder_](const std::stop_token& stop) {
      for (const LogFileEntry& log : unfinished) {
        if (stop.stop_requested()) return;
        if (const auto outcome = folder.Recover(log.name, stop)) SPDLOG_WARN("recording: {}", *outcome);
      }
    });
    if (mender) {
      mender_ = *std::move(mender);
    } else {
      SPDLOG_ERROR("recording: {} unfinished logs stay as they are until the next start: {}",
                   unfinished.size(), mender.error().message);
    }
  }
  if (!config_.at_start) return;
  v1::StartRecordingRequest request;
  request.set_pictures(config_.pictures);
  const auto started = Start(request, "recording.at_start");
  if (!started) SPDLOG_ERROR("recording: did not begin: {}", started.error().message);
}

Result<RecordingOrder> Recorder::ToOrder(const v1::StartRecordingRequest& request) const {
  RecordingOrder order{.name = request.name().empty() ? arm_.name() : request.name(),
                       .pictures = request.pictures(),
                       .note = request.note()};
  if (const auto good = CheckName(order.name); !good)
    return Error{good.error().code, "name " + good.error().message};
  const auto links = FindLinks(arm_.link_names(), request.links());
  if (!links) return links.error();
  order.links = *links;
  order.compression = FromWire(request.compression())
                          .value_or(order.pictures ? config_.picture_compression : config_.compression);
  return order;
}

Result<v1::RecorderStatus> Recorder::Start(const v1::StartRecordingRequest& request, const std::string& who) {
  const std::lock_guard one(order_mutex_);
  const auto order = ToOrder(request);
  if (!order) return order.error();
  if (const auto good = CheckFolder(); !good) return good.error();
  {
    const std::lock_guard lock(mutex_);
    if (recording_)
      return Error{ErrorCode::kFailedPrecondition,
                   recording_->Status().log() + " is being recorded; stop that first"};
  }
  LogPreamble preamble = preamble_;
  mcap::TextMap& metadata = preamble.metadata[wire::log::kMetadataName];
  metadata["started_by"] = who;
  metadata["pictures"] = order->pictures ? "true" : "false";
  if (!order->note.empty()) metadata["note"] = order->note;
  for (size_t link = 0; link < arm_.links().size(); ++link) {
    std::string acceptance = arm_.acceptances().FinishedFile(link);
    if (acceptance.empty() || arm_.plays_log()) continue;  // a log's attachments are in the preamble
    preamble.files.push_back({wire::log::AcceptanceAttachment(arm_.links()[link].name), "application/json",
                              std::move(acceptance)});
  }
  auto started = Recording::Start(arm_, config_, folder_, *order, std::move(preamble));
  if (!started) return started.error();
  {
    const std::lock_guard lock(mutex_);
    recording_ = std::move(*started);
  }
  const v1::RecorderStatus status = Status();
  SPDLOG_INFO("{}: recording {} begins", who, status.log());
  arm_.events().Post(EventKind::kRecording, std::nullopt,
                     {.who = who, .outcome = status.log() + " begins", .values = {}});
  return status;
}

Result<v1::RecorderStatus> Recorder::Stop(const std::string& who) {
  const std::lock_guard one(order_mutex_);
  std::shared_ptr<Recording> recording;
  {
    const std::lock_guard lock(mutex_);
    recording = recording_;
  }
  if (!recording) return Error{ErrorCode::kFailedPrecondition, "nothing is being recorded"};
  recording->Stop();
  {
    const std::lock_guard lock(mutex_);
    last_ = recording->Status();
    recording_.reset();
  }
  const v1::RecorderStatus status = Status();
  SPDLOG_INFO("{}: recording {} ends: {} frames, {} lost", who, status.log(), status.frames(),
              status.frames_lost());
  arm_.events().Post(EventKind::kRecording, std::nullopt,
                     {.who = who,
                      .outcome = status.log() + " ends",
                      .values = {{"frames", static_cast<double>(status.frames())},
                                 {"frames_lost", static_cast<double>(status.frames_lost())}}});
  return status;
}

v1::RecorderStatus Recorder::Status() const {
  v1::RecorderStatus status;
  {
    const std::lock_guard lock(mutex_);
    status = recording_ ? recording_->Status() : last_;
    if (!recording_) {
      status.set_state(v1::RECORDER_STATE_IDLE);
      status.clear_trouble();
    }
  }
  status.set_folder(folder_.path());
  status.set_quota_bytes(static_cast<uint64_t>(config_.quota_mb * 1e6));
  if (!folder_.path().empty()) status.set_free_bytes(folder_.FreeBytes());
  return status;
}

}  // namespace taclink::server

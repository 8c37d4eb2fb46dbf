#include "server/recording/recording.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <utility>

#include "server/thread_setup.h"
#include "taclink/v1/frame.pb.h"
#include "wire/log/picture.h"

namespace taclink::server {
namespace {

using wire::log::TopicKind;

constexpr std::chrono::milliseconds kPoll{20};
constexpr size_t kQueuedFrames = 4096;
constexpr int64_t kNsPerS = 1'000'000'000;
constexpr int64_t kQuotaPeriodNs = 10 * kNsPerS;
constexpr int kFailuresBeforeNewFile = 5;
constexpr uint64_t kPictureChunkBytes = uint64_t{4} << 20;

uint64_t Megabytes(double mb) {
  return static_cast<uint64_t>(mb * 1e6);
}

mcap::WriterOptions ToWriter(const RecordingOrder& order) {
  mcap::WriterOptions options{.compression = order.compression};
  if (order.pictures) options.chunk_bytes = kPictureChunkBytes;
  return options;
}

}  // namespace

Recording::Recording(Arm& arm, const RecordingConfig& config, RecordingOrder order, LogPreamble preamble)
    : arm_(arm),
      config_(config),
      order_(std::move(order)),
      preamble_(std::move(preamble)),
      folder_(config.folder),
      losses_(arm.links().size()),
      dropped_(arm.links().size(), 0) {}

Result<std::unique_ptr<Recording>> Recording::Start(Arm& arm, const RecordingConfig& config,
                                                    const RecordingOrder& order, LogPreamble preamble) {
  std::unique_ptr<Recording> out(new Recording(arm, config, order, std::move(preamble)));
  auto file = out->NewFile();
  if (!file) return file.error();
  out->file_ = std::move(*file);
  out->synced_ns_ = out->quota_ns_ = arm.clock().MonotonicNs();
  out->status_.set_started_utc_ns(out->file_->started_utc_ns());
  out->status_.set_pictures(order.pictures);
  out->others_ = std::make_unique<ArmRecorder>(
      arm, config.scene_rate_hz,
      [self = out.get()](const auto& topic, const auto& message, const auto& stamp) {
        self->Wrote(self->file_->writer().Write(topic, message, stamp));
      });
  out->subscription_ = arm.hub().Subscribe({.links = order.links,
                                            .delivery = Delivery::kEvery,
                                            .queue_capacity = kQueuedFrames,
                                            .queue_bytes = Megabytes(config.queue_mb),
                                            .detail = Detail::kFull,
                                            .pictures = order.pictures},
                                           [] {});
  out->UpdateStatus();
  out->thread_ = std::jthread([self = out.get()](const std::stop_token& stop) { self->Run(stop); });
  return out;
}

Recording::~Recording() {
  Stop();
}

void Recording::Stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

Result<std::unique_ptr<LogFile>> Recording::NewFile() {
  const int64_t utc_ns = arm_.clock().UtcNs();
  LogPreamble preamble = preamble_;
  preamble.metadata[wire::log::kMetadataName]["part"] = std::to_string(part_ + 1);
  auto file =
      LogFile::Create(folder_, LogName(order_.name, utc_ns, part_ + 1), preamble, ToWriter(order_), utc_ns);
  if (!file) return file.error();
  ++part_;
  chunks_ = 0;
  return file;
}

void Recording::Run(const std::stop_token& stop) {
  SetUpThread("recording", {});
  std::mutex mutex;
  std::condition_variable_any stopped;
  while (!stop.stop_requested()) {
    std::unique_lock lock(mutex);
    stopped.wait_for(lock, stop, kPoll, [] { return false; });
    const int64_t utc_ns = arm_.clock().UtcNs();  // what was published before is in the log after Drain
    Guarded([&] {
      Drain();
      SyncIfDue(utc_ns);
      SplitIfDue();
    });
    UpdateStatus();
  }
  Guarded([this] { Drain(); });
  Guarded([this] {
    for (size_t link = 0; link < losses_.links(); ++link) TellLosses(link, 0);
    CloseFile(*file_);
  });
  UpdateStatus();
}

// No exception ends the thread: the next round tries again.
void Recording::Guarded(const std::function<void()>& step) {
  try {
    step();
  } catch (const std::exception& e) {
    SetTrouble(e.what());
  }
}

void Recording::Drain() {
  PicturesPtr pictures;
  while (const auto publication = subscription_->Take(nullptr, &pictures)) {
    NoteDrops();
    TakeFrame(*publication, pictures);
    pictures.reset();
  }
  others_->TakeRest();
}

// The queue counts a frame that fell out before the next one is taken.
void Recording::NoteDrops() {
  const uint64_t dropped = subscription_->dropped();
  if (std::exchange(dropped_total_, dropped) == dropped) return;
  const auto counts = subscription_->Counts();
  for (size_t link = 0; link < counts.size(); ++link) {
    losses_.Dropped(link, counts[link].dropped - dropped_[link]);
    dropped_[link] = counts[link].dropped;
  }
}

int64_t Recording::UtcOf(const LinkState& state) const {
  const FrameTimes& times = state.times;
  if (times.exposure_utc_ns != 0 && !state.replayed)
    return times.exposure_utc_ns + (times.published_ns - times.exposure_monotonic_ns);
  return arm_.clock().UtcNs() - (arm_.clock().MonotonicNs() - times.published_ns);
}

void Recording::TakeFrame(const Publication& publication, const PicturesPtr& pictures) {
  const LinkState& state = publication.state();
  const std::string& link = arm_.links()[publication.link()].name;
  const wire::log::Stamp stamp{
      .log_utc_ns = UtcOf(state), .publish_utc_ns = state.times.exposure_utc_ns, .sequence = state.sequence};
  TellLosses(publication.link(), state.sequence);
  wire::log::LogWriter& writer = file_->writer();
  for (size_t i = 0; pictures && i < pictures->raw.size(); ++i) {
    const RawImage& image = pictures->raw[i];
    if (!image.valid) continue;
    const auto encoded = wire::log::EncodePicture(image, wire::log::CameraFrameId(link, kBothCameras[i]),
                                                  state.times.exposure_utc_ns);
    Wrote(writer.Write({.kind = TopicKind::kPicture, .link = link, .camera = kBothCameras[i]}, *encoded.type,
                       encoded.bytes, stamp));
  }
  const auto written = writer.Write({.kind = TopicKind::kFrame, .link = link}, *v1::LinkFrame::descriptor(),
                                    publication.Encoded(Detail::kFull), stamp);
  losses_.Wrote(publication.link(), state.sequence);
  Wrote(written);
  others_->TakeFrame(publication, stamp.log_utc_ns);
}

void Recording::TellLosses(size_t link, uint64_t next_sequence) {
  auto loss = losses_.Untold(link, next_sequence);
  if (!loss) return;
  const int64_t utc_ns = arm_.clock().UtcNs();
  loss->set_link(arm_.links()[link].name);
  loss->set_utc_ns(utc_ns);
  const auto written = file_->writer().Write({.kind = TopicKind::kLosses}, *loss, {.log_utc_ns = utc_ns});
  losses_.Told(link, loss->count());
  Wrote(written);
}

// After each message that was handed over: whether a chunk has gone into the file, or was lost.
void Recording::Wrote(const Result<void>& written) {
  if (!written) {
    losses_.ChunkLost(written.error().message);
    SetTrouble(written.error().message);
  }
  if (file_->chunks() == chunks_) return;
  chunks_ = file_->chunks();
  losses_.Kept();
}

void Recording::SyncIfDue(int64_t utc_ns) {
  const int64_t now_ns = arm_.clock().MonotonicNs();
  if (static_cast<double>(now_ns - synced_ns_) < config_.sync_s * 1e9) return;
  synced_ns_ = now_ns;
  const auto synced = file_->Sync();
  Wrote(synced);
  if (!synced) {
    if (++failures_ % kFailuresBeforeNewFile == 0) NextFile();
    return;
  }
  failures_ = 0;
  if (!trouble_.empty()) spdlog::info("recording: goes on; {} frames were lost", losses_.lost());
  trouble_.clear();
  const std::lock_guard lock(mutex_);
  status_.set_synced_utc_ns(utc_ns);
}

void Recording::SplitIfDue() {
  const int64_t age_ns = arm_.clock().UtcNs() - file_->started_utc_ns();
  const bool large = config_.split_mb > 0 && file_->bytes() >= Megabytes(config_.split_mb);
  const bool old = config_.split_s > 0 && static_cast<double>(age_ns) >= config_.split_s * 1e9;
  if ((large || old) && trouble_.empty()) NextFile();
  const int64_t now_ns = arm_.clock().MonotonicNs();
  if (config_.quota_mb <= 0 || now_ns - quota_ns_ < kQuotaPeriodNs) return;
  quota_ns_ = now_ns;
  for (const std::string& name : folder_.EnforceQuota(Megabytes(config_.quota_mb)))
    spdlog::info("recording: {} deleted for recording.quota_mb", name);
}

void Recording::NextFile() {
  auto next = NewFile();
  if (!next) return SetTrouble(next.error().message);
  const std::unique_ptr<LogFile> last = std::exchange(file_, std::move(*next));
  CloseFile(*last);
  frames_before_ = losses_.written();
  bytes_ += last->bytes();
  others_->BeginLog();
  quota_ns_ = 0;
}

void Recording::CloseFile(LogFile& file) {
  const auto closed = file.Close({{"frames", std::to_string(losses_.written() - frames_before_)},
                                  {"contacts", std::to_string(others_->contacts_begun())},
                                  {"frames_lost", std::to_string(losses_.lost())}});
  if (closed) {
    losses_.Kept();
  } else {
    losses_.ChunkLost(closed.error().message);
    SetTrouble(closed.error().message);
  }
}

void Recording::SetTrouble(const std::string& trouble) {
  if (trouble_ == trouble) return;
  trouble_ = trouble;
  spdlog::error("recording: {}", trouble);
  arm_.events().Post(EventKind::kRecording, std::nullopt,
                     {.who = "server", .accepted = false, .outcome = trouble, .values = {}});
}

void Recording::UpdateStatus() {
  const std::lock_guard lock(mutex_);
  status_.set_state(trouble_.empty() ? v1::RECORDER_STATE_RECORDING : v1::RECORDER_STATE_TROUBLE);
  status_.set_trouble(trouble_);
  status_.set_log(file_->name());
  status_.set_logs(static_cast<uint32_t>(part_));
  status_.set_bytes(bytes_ + file_->bytes());
  status_.set_frames(losses_.written());
  status_.set_events(others_->events());
  status_.set_frames_lost(losses_.lost());
}

v1::RecorderStatus Recording::Status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace taclink::server

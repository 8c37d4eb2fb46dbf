#include "server/recording/recording.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <limits>
#include <utility>

#include "sensing/core/thread_start.h"
#include "server/process/system_limits.h"
#include "taclink/v1/frame.pb.h"
#include "wire/log/picture.h"

namespace taclink::server {
namespace {

using wire::log::TopicKind;

constexpr std::chrono::milliseconds kPoll{20};
constexpr int64_t kRoundNs = 200'000'000;
constexpr size_t kQueuedFrames = 4096;
constexpr int64_t kNsPerS = 1'000'000'000;
constexpr int64_t kLookPeriodNs = kNsPerS / 2, kQuietNs = 10 * kNsPerS;
constexpr int64_t kQuotaPeriodNs = 10 * kNsPerS;
constexpr int kFailuresBeforeNewFile = 5;
constexpr int kNameTries = 100;
constexpr uint64_t kPictureChunkBytes = uint64_t{4} << 20;

constexpr const char* kBehind =
    "frames come faster than they are written, and are lost; record fewer links or without pictures, onto a "
    "faster "
    "disk, or raise recording.queue_mb";

uint64_t Megabytes(double mb) {
  return static_cast<uint64_t>(mb * 1e6);
}

// The first of them; an event has room for some.
std::string NamesOf(const std::vector<std::string>& logs) {
  constexpr size_t kMost = 8;
  std::string out;
  for (size_t i = 0; i < std::min(logs.size(), kMost); ++i) out += (i == 0 ? "" : ", ") + logs[i];
  return logs.size() > kMost ? fmt::format("{} and {} more", out, logs.size() - kMost) : out;
}

mcap::WriterOptions ToWriter(const RecordingOrder& order) {
  mcap::WriterOptions options{.compression = order.compression};
  if (order.pictures) options.chunk_bytes = kPictureChunkBytes;
  return options;
}

}  // namespace

Recording::Recording(Arm& arm, const RecordingConfig& config, const LogFolder& folder, RecordingOrder order,
                     LogPreamble preamble)
    : arm_(arm),
      config_(config),
      order_(std::move(order)),
      preamble_(std::move(preamble)),
      folder_(folder),
      log_clock_(arm.clock()),
      losses_(arm.links().size()),
      dropped_(arm.links().size(), 0) {}

Result<std::unique_ptr<Recording>> Recording::Start(Arm& arm, const RecordingConfig& config,
                                                    const LogFolder& folder, const RecordingOrder& order,
                                                    LogPreamble preamble) {
  std::unique_ptr<Recording> out(new Recording(arm, config, folder, order, std::move(preamble)));
  auto file = out->NewFile();
  if (!file) return file.error();
  out->file_ = std::move(*file);
  out->synced_ns_ = out->looked_ns_ = arm.clock().MonotonicNs();
  out->status_.set_started_utc_ns(out->file_->started_utc_ns());
  out->status_.set_pictures(order.pictures);
  out->others_ = std::make_unique<ArmRecorder>(
      arm, out->log_clock_, config.scene_rate_hz,
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
  auto thread =
      StartThread("recording", [self = out.get()](const std::stop_token& stop) { self->Run(stop); });
  if (!thread) {
    out->file_->Discard();
    return thread.error();
  }
  out->thread_ = *std::move(thread);
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
  // Another recording may have begun within the same second.
  int number = part_ + 1;
  const auto name = [&] { return LogName(order_.name, utc_ns, number); };
  while (folder_.Find(name())) ++number;
  auto file = LogFile::Create(folder_, name(), preamble, ToWriter(order_), utc_ns);
  // Another server may have taken the name meanwhile.
  for (int tries = 0; !file && folder_.Find(name()) && tries < kNameTries; ++tries) {
    ++number;
    file = LogFile::Create(folder_, name(), preamble, ToWriter(order_), utc_ns);
  }
  if (!file) return file.error();
  if (const auto ranked = folder_.Begin((*file)->name()); !ranked) {
    if (config_.quota_mb > 0) {
      (*file)->Discard();
      return ranked.error();
    }
    SPDLOG_WARN("recording: {}", ranked.error().message);
  }
  ++part_;
  return file;
}

void Recording::Run(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any stopped;
  while (!stop.stop_requested()) {
    std::unique_lock lock(mutex);
    if (subscription_->waiting() == 0) stopped.wait_for(lock, stop, kPoll, [] { return false; });
    Guarded([&] {
      Drain(kRoundNs);
      LookIfDue();
      SyncIfDue();
      SplitIfDue();
      EnforceQuotaIfDue();
    });
    UpdateStatus();
  }
  Guarded([this] { Drain(std::numeric_limits<int64_t>::max()); });
  Guarded([this] {
    for (size_t link = 0; link < losses_.links(); ++link) TellLosses(link, 0);
    CloseFile(*file_);
    quota_ns_ = 0;  // short recordings count, too
    EnforceQuotaIfDue();
  });
  UpdateStatus();
}

// No exception ends the thread: the next round tries again.
void Recording::Guarded(const std::function<void()>& step) {
  try {
    step();
  } catch (const std::exception& e) {
    SetTrouble(trouble_, DescribeLimit(e));
  }
}

// What waits at the call, and no longer than that takes or `most_ns`: where frames come faster than they are
// written, the round must end all the same for the log to be synced and the status to be told.
void Recording::Drain(int64_t most_ns) {
  const int64_t begun_ns = arm_.clock().MonotonicNs(), begun_utc_ns = arm_.clock().UtcNs();
  size_t waiting = subscription_->waiting();
  PicturesPtr pictures;
  int64_t taken_ns = 0;  // published when
  for (; waiting > 0 && arm_.clock().MonotonicNs() - begun_ns < most_ns; --waiting) {
    const auto publication = subscription_->Take(nullptr, &pictures);
    if (!publication) {
      waiting = 0;
      break;
    }
    taken_ns = publication->state().times.published_ns;
    NoteDrops();
    TakeFrame(*publication, pictures);
    pictures.reset();
  }
  others_->TakeRest();
  if (waiting == 0)
    written_utc_ns_ = begun_utc_ns;
  else if (taken_ns != 0)
    written_utc_ns_ = begun_utc_ns - (begun_ns - taken_ns);
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
  if (!std::exchange(is_behind_, true)) TellTrouble("behind", kBehind);
}

void Recording::TakeFrame(const Publication& publication, const PicturesPtr& pictures) {
  const LinkState& state = publication.state();
  const std::string& link = arm_.links()[publication.link()].name;
  const wire::log::Stamp stamp{.log_utc_ns = log_clock_.Utc(state.times.published_ns),
                               .publish_utc_ns = state.times.exposure_utc_ns,
                               .sequence = state.sequence};
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
  if (written) digest_.Take(link, arm_.links()[publication.link()].model, state, stamp.log_utc_ns);
}

void Recording::TellLosses(size_t link, uint64_t next_sequence) {
  auto loss = losses_.Untold(link, next_sequence);
  if (!loss) return;
  const int64_t utc_ns = log_clock_.NowUtc();
  loss->set_link(arm_.links()[link].name);
  loss->set_utc_ns(utc_ns);
  const auto written = file_->writer().Write({.kind = TopicKind::kLosses}, *loss, {.log_utc_ns = utc_ns});
  losses_.Told(link, loss->count());
  Wrote(written);
}

// After each message that was handed over: whether a chunk has gone into the file, or was lost.
void Recording::Wrote(const Result<void>& written) {
  if (!written) {
    losses_.Lost(LogStage::kOpen, written.error().message);
    SetTrouble(trouble_, written.error().message);
  }
  if (std::exchange(chunks_, file_->chunks()) != file_->chunks()) losses_.Taken();
}

// Whether what is written is what people will find.
void Recording::LookIfDue() {
  const int64_t now_ns = arm_.clock().MonotonicNs();
  if (now_ns - looked_ns_ < kLookPeriodNs) return;
  looked_ns_ = now_ns;
  FollowClock();
  if (file_->WhereItIs() == mcap::FileSink::Place::kThere) {
    const auto writable = folder_.CheckWritable();
    if (writable) return place_trouble_.text.clear();
    return SetTrouble(place_trouble_, writable.error().message +
                                          "; the log that is being written goes on, but no other can begin");
  }
  const std::string what = Misplaced(*file_);
  TellTrouble("misplaced", what);
  auto next = folder_.Prepare();
  if (next) next = NextFile();
  if (next) return place_trouble_.text.clear();
  SetTrouble(place_trouble_, what + "; the next one can't begin: " + next.error().message);
}

// What that means for a log that is not what was written; counts what is lost.
std::string Recording::Misplaced(const LogFile& file) {
  using Place = mcap::FileSink::Place;
  const std::string path = folder_.PartPath(file.name());
  const Place place = file.WhereItIs();
  if (place == Place::kElsewhere)
    return path +
           " was moved, or its disk was taken away, while it was written: what was recorded is where it is "
           "now";
  std::string gone =
      path + (place == Place::kCut ? " was cut by another program" : " was deleted while it was written");
  gone += ": what was recorded is lost";
  losses_.Lost(LogStage::kSafe, gone);
  return gone;
}

void Recording::SyncIfDue() {
  const int64_t now_ns = arm_.clock().MonotonicNs();
  if (static_cast<double>(now_ns - synced_ns_) < config_.sync_s * 1e9) return;
  synced_ns_ = now_ns;
  if (!Sync()) return;
  failures_ = 0;
  const bool was_in_trouble = is_behind_ || !trouble_.text.empty();
  trouble_.text.clear();
  is_behind_ = is_behind_ && std::exchange(dropped_synced_, dropped_total_) != dropped_total_;
  if (was_in_trouble && !is_behind_) SPDLOG_INFO("recording: goes on; {} frames were lost", losses_.lost());
  const std::lock_guard lock(mutex_);
  status_.set_synced_utc_ns(written_utc_ns_);
}

// What a file has taken but could not sync, it may have lost, and would not say so again.
bool Recording::Sync() {
  const auto flushed = file_->Flush();
  Wrote(flushed);
  const auto synced = flushed ? file_->Sync() : flushed;
  if (synced) {
    losses_.Synced();
    return true;
  }
  if (flushed) {
    losses_.Lost(LogStage::kTaken, synced.error().message);
    SetTrouble(trouble_, synced.error().message);
  }
  const bool is_doubtful = flushed.ok() && failures_ == 0;
  if (++failures_ % kFailuresBeforeNewFile != 0 && !is_doubtful) return false;
  static_cast<void>(NextFile());  // where that fails too, what is wrong with the disk is told already
  return false;
}

// Where no other log can begin, this one goes on with its own time line.
void Recording::FollowClock() {
  const auto step_ns = log_clock_.Step();
  if (!step_ns) return;
  const double step_s = static_cast<double>(*step_ns) * 1e-9;
  if (const auto next = NextFile(); !next)
    return SetTrouble(split_trouble_,
                      fmt::format("the clock was set by {:+.3f} s, and no other log can begin: {}", step_s,
                                  next.error().message));
  SPDLOG_WARN("recording: the clock was set by {:+.3f} s; another log begins", step_s);
}

void Recording::SplitIfDue() {
  const bool large = config_.split_mb > 0 && file_->bytes() >= Megabytes(config_.split_mb);
  const bool old = config_.split_s > 0 && static_cast<double>(log_clock_.AgeNs()) >= config_.split_s * 1e9;
  if ((large || old) && trouble_.text.empty() && place_trouble_.text.empty()) {
    if (const auto next = NextFile(); !next) SetTrouble(split_trouble_, next.error().message);
  }
}

void Recording::EnforceQuotaIfDue() {
  const int64_t now_ns = arm_.clock().MonotonicNs();
  if (config_.quota_mb <= 0 || (quota_ns_ != 0 && now_ns - quota_ns_ < kQuotaPeriodNs)) return;
  quota_ns_ = now_ns;
  const auto deleted = folder_.EnforceQuota(Megabytes(config_.quota_mb));
  if (deleted.empty()) return;
  const std::string what = fmt::format("{} deleted: the logs of {} exceeded recording.quota_mb ({})",
                                       NamesOf(deleted), folder_.path(), config_.quota_mb);
  SPDLOG_INFO("recording: {}", what);
  arm_.events().Post(
      EventKind::kRecording, std::nullopt,
      {.who = "server", .outcome = what, .values = {{"logs_deleted", static_cast<double>(deleted.size())}}});
}

// Errors: as LogFile::Create; the log that is there goes on.
Result<void> Recording::NextFile() {
  auto next = NewFile();
  if (!next) return next.error();
  const std::unique_ptr<LogFile> last = std::exchange(file_, std::move(*next));
  CloseFile(*last);
  losses_.NextLog();
  log_clock_.Begin();
  chunks_ = 0;
  frames_before_ = losses_.written();
  bytes_ += last->bytes();
  others_->BeginLog();
  quota_ns_ = 0;
  split_trouble_.text.clear();
  return {};
}

void Recording::CloseFile(LogFile& file) {
  const v1::LogSummary summary = digest_.Summary();
  digest_.Clear();
  const auto place = file.WhereItIs();
  if (place == mcap::FileSink::Place::kNowhere || place == mcap::FileSink::Place::kCut)
    return TellTrouble("misplaced", Misplaced(file));
  const auto closed = file.Close({{"frames", std::to_string(losses_.written() - frames_before_)},
                                  {"contacts", std::to_string(others_->contacts_begun())},
                                  {"frames_lost", std::to_string(losses_.lost())}},
                                 summary);
  if (!closed) SetTrouble(trouble_, closed.error().message);
  if (file.chunks() != chunks_) losses_.Taken();
  if (!closed) losses_.Lost(LogStage::kOpen, closed.error().message);
  if (file.is_complete() || file.Sync()) return losses_.Synced();
  losses_.Lost(LogStage::kTaken, closed.error().message);
}

void Recording::SetTrouble(Trouble& trouble, const std::string& text) {
  trouble.text = text;
  TellTrouble(trouble.kind, text);
}

// What can't be mended comes back with every try, each time with other words: it is told once, and again when
// it comes back after a quiet while.
void Recording::TellTrouble(const std::string& kind, const std::string& trouble) {
  const int64_t now_ns = arm_.clock().MonotonicNs();
  {
    const std::lock_guard lock(mutex_);
    status_.set_last_trouble(trouble);
    status_.set_last_trouble_utc_ns(arm_.clock().UtcNs());
  }
  const auto [came, is_first] = came_ns_.emplace(kind, now_ns);
  if (!is_first && now_ns - std::exchange(came->second, now_ns) < kQuietNs) return;
  SPDLOG_ERROR("recording: {}", trouble);
  arm_.events().Post(EventKind::kRecording, std::nullopt,
                     {.who = "server", .accepted = false, .outcome = trouble, .values = {}});
}

void Recording::UpdateStatus() {
  const std::lock_guard lock(mutex_);
  std::string trouble = is_behind_ ? kBehind : "";
  for (const Trouble* one : {&split_trouble_, &place_trouble_, &trouble_}) {
    if (!one->text.empty()) trouble = one->text;
  }
  status_.set_state(trouble.empty() ? v1::RECORDER_STATE_RECORDING : v1::RECORDER_STATE_TROUBLE);
  status_.set_trouble(trouble);
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

#include "server/replay/replay_link.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/link/link_outlet.h"
#include "wire/frame_codec.h"

namespace taclink::server {
namespace {

constexpr int64_t kLateNs = 200'000'000;   // who is later than this goes on with the newest
constexpr int64_t kGapNs = 1'500'000'000;  // a recorded link says something once a second
// So that supervision bears those seconds of silence; see SupervisorOptions.
constexpr double kLeastRateHz = 1;

void Move(int64_t& time_ns, int64_t by_ns) {
  if (time_ns != 0) time_ns += by_ns;
}

class ReplaySource final : public FrameSource {
 public:
  ReplaySource(ReplayLink link, Clock& clock) : link_(std::move(link)), clock_(clock) {}

  Result<void> Start() override {
    auto track = ReplayTrack::Open(
        link_.log, {.links = {link_.link}, .events = false, .contacts = false, .arm = false, .losses = false},
        link_.schedule);
    if (!track) return track.error();
    track_ = std::move(*track);
    next_.reset();
    said_ns_ = clock_.MonotonicNs();
    return {};
  }

  Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) override {
    if (!track_) return Error{ErrorCode::kUnavailable, "the log is not open: start it"};
    if (const auto fetched = Fetch(); !fetched) return fetched;
    const int64_t now_ns = clock_.MonotonicNs();
    if (due_ns_ < now_ns - kLateNs && !caught_up_) {
      track_->CatchUp();
      caught_up_ = true;  // what comes now counts, however old it is
      next_.reset();
      ++counters_.skipped_pairs;
      if (const auto fetched = Fetch(); !fetched) return fetched;
    }
    const int64_t until_ns = now_ns + std::chrono::nanoseconds(timeout).count();
    const int64_t wake_ns = std::min({due_ns_, said_ns_ + kGapNs, until_ns});
    if (wake_ns > now_ns) clock_.SleepUntilMonotonicNs(wake_ns);
    const int64_t then_ns = clock_.MonotonicNs();
    if (then_ns >= due_ns_) {
      caught_up_ = false;
      Give(std::exchange(next_, nullptr), frame);
    } else if (then_ns >= said_ns_ + kGapNs) {
      Give(Gap(), frame);
    } else {
      return Error{ErrorCode::kTimeout, "the log's next frame is not due yet"};
    }
    said_ns_ = then_ns;
    return {};
  }

  SourceInfo Info() const override {
    return {.description = "log " + link_.log_name, .frame_rate_hz = kLeastRateHz};
  }
  SourceCounters Counters() const override { return counters_; }

 private:
  Result<void> Fetch() {
    while (!next_) {
      const auto item = track_->Next();
      if (!item) return item.error();
      auto decoded = wire::DecodeFrame(mcap::AsText(item->data));
      if (!decoded) {
        if (!std::exchange(complained_, true))
          SPDLOG_WARN("link {}: a frame of the log is left out: {}", link_.link, decoded.error().message);
        continue;
      }
      due_ns_ = item->due_ns;
      next_ = Moved(std::move(decoded->state));
    }
    return {};
  }

  std::shared_ptr<const LinkState> Moved(LinkState state) const {
    const int64_t by_ns = due_ns_ - state.times.published_ns;
    for (int64_t* time_ns : {&state.times.exposure_monotonic_ns, &state.times.received_ns,
                             &state.times.tracked_ns, &state.times.solved_ns, &state.times.published_ns})
      Move(*time_ns, by_ns);
    state.replayed = true;
    return std::make_shared<const LinkState>(std::move(state));
  }

  std::shared_ptr<const LinkState> Gap() const {
    auto state = std::make_shared<LinkState>();
    ResetTo(*state, LinkStatus::kLost, "the log has no frames of this link here", ReasonId::kNoFrames);
    state->sequence = sequence_;
    state->replayed = true;
    return state;
  }

  void Give(std::shared_ptr<const LinkState> state, StereoFrame& frame) {
    for (RawImage& image : frame.images) image.valid = false;
    frame.sequence = sequence_ = state->sequence;
    frame.times = state->times;
    frame.recorded = std::move(state);
  }

  // Constant after construction.
  const ReplayLink link_;
  Clock& clock_;

  std::unique_ptr<ReplayTrack> track_;
  std::shared_ptr<const LinkState> next_;
  int64_t due_ns_ = 0;   // of next_
  int64_t said_ns_ = 0;  // anything, last
  uint64_t sequence_ = 0;
  bool caught_up_ = false;
  bool complained_ = false;
  SourceCounters counters_;
};

class ReplayProcessor final : public LinkProcessor {
 public:
  void Process(const StereoFrame& frame, LinkState& state) override {
    if (frame.recorded) state = *frame.recorded;
  }
  Result<void> BeginTare(const TareOptions&) override { return PlaysLog(); }
  Result<void> BeginCalibration(const CalibrationOrder&) override { return PlaysLog(); }
  CalibrationProgress PollCalibration() override { return {.end = PlaysLog()}; }
  void CancelCalibration() override {}
};

}  // namespace

Error PlaysLog() {
  return {ErrorCode::kFailedPrecondition,
          "the server plays a log: its links can only be looked at; start it without --replay"};
}

std::unique_ptr<FrameSource> MakeReplaySource(ReplayLink link, Clock& clock) {
  return std::make_unique<ReplaySource>(std::move(link), clock);
}

std::unique_ptr<LinkProcessor> MakeReplayProcessor() {
  return std::make_unique<ReplayProcessor>();
}

}  // namespace taclink::server

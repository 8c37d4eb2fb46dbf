#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_state.h"
#include "server/hub/hub.h"
#include "server/link/link_processor.h"

namespace taclink::server {

// Longer than any test may take on any machine: it ends a test that hangs, nothing is judged by it.
inline constexpr std::chrono::seconds kForever{120};

/// Time as the test says. Sleepers wake when it is reached, or after a moment, as Clock's users must bear.
class ManualClock final : public Clock {
 public:
  int64_t MonotonicNs() const override {
    const std::lock_guard lock(mutex_);
    return now_ns_;
  }
  int64_t UtcNs() const override {
    const std::lock_guard lock(mutex_);
    return now_ns_ + utc_offset_ns_;
  }
  void SleepUntilMonotonicNs(int64_t time_ns) override {
    std::unique_lock lock(mutex_);
    if (sleeping_passes_time_) {
      now_ns_ = std::max(now_ns_, time_ns);
    } else {
      changed_.wait_for(lock, std::chrono::milliseconds(5), [&] { return now_ns_ >= time_ns; });
    }
  }

  void Advance(std::chrono::nanoseconds by) {
    {
      const std::lock_guard lock(mutex_);
      now_ns_ += by.count();
    }
    changed_.notify_all();
  }
  /// As if somebody set the clock.
  void StepUtc(std::chrono::nanoseconds by) {
    const std::lock_guard lock(mutex_);
    utc_offset_ns_ += by.count();
  }
  /// A sleep returns at once with the time it slept to.
  void LetSleepingPassTime() { sleeping_passes_time_ = true; }

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int64_t now_ns_ = 1'000'000'000;
  int64_t utc_offset_ns_ = 1'700'000'000'000'000'000;
  bool sleeping_passes_time_ = false;
};

/// What a FakeSource does next; the test writes it, the source's thread reads it.
class SourceScript {
 public:
  std::atomic<bool> waits_for_reader = false;

  void Push(uint64_t sequence, int64_t exposure_ns = 1) {
    StereoFrame frame;
    frame.sequence = sequence;
    frame.times.exposure_monotonic_ns = exposure_ns;
    frame.times.exposure_utc_ns = exposure_ns + 1;
    Push([frame](StereoFrame& out) -> Result<void> { return out = frame, Result<void>(); });
  }
  void PushError(ErrorCode code, std::string message) {
    Push([=](StereoFrame&) -> Result<void> { return Error{code, message}; });
  }
  void Push(std::function<Result<void>(StereoFrame&)> step) {
    const std::lock_guard lock(mutex_);
    steps_.push_back(std::move(step));
    changed_.notify_all();
  }
  using CameraOrders = std::vector<std::pair<CameraId, CameraSettings>>;
  /// Called by SetCamera.
  void OnSetCamera(std::function<void(CameraId)> hook) {
    const std::lock_guard lock(mutex_);
    on_set_camera_ = std::move(hook);
  }
  /// Called by each source as it is destroyed.
  void OnClose(std::function<void()> hook) {
    const std::lock_guard lock(mutex_);
    on_close_ = std::move(hook);
  }
  /// Sources that are not destroyed.
  std::atomic<int> living = 0;
  /// By Remember, of all sources.
  CameraOrders remembered() const {
    const std::lock_guard lock(mutex_);
    return remembered_;
  }
  /// What the source says of itself from now on.
  void Describe(SourceInfo info, SourceCounters counters) {
    const std::lock_guard lock(mutex_);
    info_ = std::move(info);
    counters_ = counters;
  }
  void FailStarts(int count, ErrorCode code = ErrorCode::kUnavailable) {
    const std::lock_guard lock(mutex_);
    failing_starts_ = count;
    start_error_ = code;
  }
  int starts() const {
    const std::lock_guard lock(mutex_);
    return starts_;
  }
  /// Until everything was taken and the source's thread came for more.
  void WaitUntilTaken() {
    std::unique_lock lock(mutex_);
    ASSERT_TRUE(changed_.wait_for(lock, kForever, [this] { return steps_.empty() && waiting_; }));
  }

 private:
  friend class FakeSource;

  Result<void> Start() {
    const std::lock_guard lock(mutex_);
    ++starts_;
    changed_.notify_all();
    if (failing_starts_ == 0) return {};
    if (failing_starts_ > 0) --failing_starts_;
    return Error{start_error_, "no camera"};
  }
  Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    waiting_ = true;
    changed_.notify_all();
    const bool any = changed_.wait_for(lock, timeout, [this] { return !steps_.empty(); });
    if (!any) return Error{ErrorCode::kTimeout, "silent"};
    waiting_ = false;
    const auto step = std::move(steps_.front());
    steps_.pop_front();
    lock.unlock();
    return step(frame);
  }

  SourceInfo Info() const {
    const std::lock_guard lock(mutex_);
    return info_;
  }
  SourceCounters Counters() const {
    const std::lock_guard lock(mutex_);
    return counters_;
  }

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  SourceInfo info_{"fake", 640, 480, 30};
  SourceCounters counters_;
  std::deque<std::function<Result<void>(StereoFrame&)>> steps_;
  bool waiting_ = false;
  int starts_ = 0;
  CameraOrders remembered_;
  std::function<void()> on_close_;
  std::function<void(CameraId)> on_set_camera_;
  int failing_starts_ = 0;  // < 0: all
  ErrorCode start_error_ = ErrorCode::kUnavailable;
};

class FakeSource final : public FrameSource {
 public:
  explicit FakeSource(std::shared_ptr<SourceScript> script) : script_(std::move(script)) {
    ++script_->living;
  }
  ~FakeSource() override {
    std::function<void()> hook;
    {
      const std::lock_guard lock(script_->mutex_);
      hook = script_->on_close_;
    }
    if (hook) hook();
    --script_->living;
  }
  FakeSource(const FakeSource&) = delete;
  FakeSource& operator=(const FakeSource&) = delete;
  Result<void> Start() override { return script_->Start(); }
  Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) override {
    return script_->Next(frame, timeout);
  }
  Result<void> SetCamera(CameraId id, const CameraSettings& settings) override {
    std::function<void(CameraId)> hook;
    {
      const std::lock_guard lock(script_->mutex_);
      hook = script_->on_set_camera_;
    }
    if (hook) hook(id);
    if (settings.gain == 99) return Error{ErrorCode::kInvalidArgument, "gain must be 0 to 64"};
    return {};
  }
  void Remember(CameraId id, const CameraSettings& settings) override {
    const std::lock_guard lock(script_->mutex_);
    script_->remembered_.emplace_back(id, settings);
  }
  bool WaitsForReader() const override { return script_->waits_for_reader; }
  SourceInfo Info() const override { return script_->Info(); }
  SourceCounters Counters() const override { return script_->Counters(); }

 private:
  const std::shared_ptr<SourceScript> script_;
};

/// Processes with a function, and calibrates as the test says; frames with a stale pressure are no rest
/// pairs. `saves` counts the calibrations that would have written a file.
class FakeProcessor final : public LinkProcessor {
 public:
  static inline std::atomic<int> saves = 0;

  using Function = std::function<void(const StereoFrame&, LinkState&)>;
  explicit FakeProcessor(Function process, std::optional<Error> refusal = {})
      : process_(std::move(process)), refusal_(std::move(refusal)) {}

  void Process(const StereoFrame& frame, LinkState& state) override {
    is_rest_pair_ = !frame.pressure.stale;
    if (calibrating_ && is_rest_pair_) ++taken_;
    process_(frame, state);
  }
  Result<void> BeginCalibration(const CalibrationOrder& order) override {
    if (refusal_) return *refusal_;
    wanted_ = order.pairs;
    taken_ = 0;
    calibrating_ = true;
    order_ = order;
    return {};
  }
  CalibrationProgress PollCalibration() override {
    CalibrationProgress progress{.taken = taken_,
                                 .wanted = wanted_,
                                 .waiting_for = is_rest_pair_ ? "" : "a stale pressure",
                                 .end = {}};
    if (taken_ < wanted_) return progress;
    calibrating_ = false;
    if (order_.save && (!order_.may_save || order_.may_save())) ++saves;
    progress.end =
        CalibrationResult{.markers_used = 200, .rms_px = 0.25, .rmse_r_mm = 0.5, .file_text = "text"};
    return progress;
  }
  void CancelCalibration() override { calibrating_ = false; }

  Result<void> BeginTare(const TareOptions& options) override {
    if (refusal_) return *refusal_;
    tare_ = options;
    tare_taken_ = 0;
    return {};
  }
  std::optional<Result<TareSummary>> TakeTareEnd() override {
    if (!tare_ || ++tare_taken_ < tare_->frames) return {};
    const TareOptions done = *std::exchange(tare_, std::nullopt);
    return TareSummary{.frames = done.frames, .forced = done.force, .shift_mm = 0.125, .previous_age_s = 60};
  }
  void CancelTare() override { tare_.reset(); }

 private:
  const Function process_;
  const std::optional<Error> refusal_;
  bool calibrating_ = false;
  bool is_rest_pair_ = true;  // the newest frame
  int taken_ = 0, wanted_ = 0;
  CalibrationOrder order_;
  std::optional<TareOptions> tare_;
  int tare_taken_ = 0;
};

/// Takes a subscription's states one by one, waiting for them.
class Receiver {
 public:
  Receiver(Hub& hub, SubscriberOptions options = {.delivery = Delivery::kEvery})
      : subscription_(hub.Subscribe(std::move(options), [signal = signal_] { signal->Set(); })) {}

  PublicationPtr Next(std::chrono::milliseconds timeout = kForever) {
    while (true) {
      if (auto publication = subscription_->Take()) return publication;
      if (!signal_->Wait(timeout)) return nullptr;
    }
  }
  Subscription& subscription() { return *subscription_; }

 private:
  struct Signal {
    void Set() {
      const std::lock_guard lock(mutex);
      set = true;
      changed.notify_all();
    }
    bool Wait(std::chrono::milliseconds timeout) {
      std::unique_lock lock(mutex);
      const bool was_set = changed.wait_for(lock, timeout, [this] { return set; });
      set = false;
      return was_set;
    }
    std::mutex mutex;
    std::condition_variable changed;
    bool set = false;
  };

  const std::shared_ptr<Signal> signal_ = std::make_shared<Signal>();
  const std::unique_ptr<Subscription> subscription_;
};

inline std::shared_ptr<const LinkState> MakeState(uint64_t sequence, int64_t published_ns = 0) {
  auto state = std::make_shared<LinkState>();
  state->sequence = sequence;
  state->times.published_ns = published_ns;
  return state;
}

}  // namespace taclink::server

#include "server/link/source_supervisor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "server/process/system_limits.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

// Libraries below a source may throw; that must not end the link's thread.
template <typename F>
Result<void> Guarded(F call) {
  try {
    return call();
  } catch (const std::exception& e) {
    return Error{ErrorCode::kInternal, DescribeLimit(e)};
  }
}

}  // namespace

SourceSupervisor::SourceSupervisor(std::string name, std::unique_ptr<FrameSource> source, Clock& clock,
                                   SupervisorOptions options, StageMark* mark)
    : name_(std::move(name)),
      clock_(clock),
      options_(options),
      mark_(mark),
      source_(std::move(source)),
      backoff_(options.first_backoff) {}

bool SourceSupervisor::Next(StereoFrame& frame, milliseconds timeout) {
  if (started_) return TryNext(frame, timeout);
  const bool ended = condition().state == SourceCondition::State::kEnded;
  const int64_t now = clock_.MonotonicNs();
  if (ended || now < retry_at_ns_) {
    Wait(ended ? now + std::chrono::nanoseconds(timeout).count() : retry_at_ns_, timeout);
  } else {
    TryStart();
  }
  return false;
}

void SourceSupervisor::Wait(int64_t until_ns, milliseconds timeout) {
  clock_.SleepUntilMonotonicNs(
      std::min(until_ns, clock_.MonotonicNs() + std::chrono::nanoseconds(timeout).count()));
}

void SourceSupervisor::TryStart() {
  if (std::exchange(ever_tried_, true)) {
    const std::lock_guard lock(mutex_);
    ++condition_.restarts;
  }
  const auto result = Guarded([this] {
    const StageScope scope(mark_, WorkStage::kSourceStart, clock_);
    return source_->Start();
  });
  Observe();
  if (!result) return Failed(result.error());
  started_ = true;
  SourceInfo info = source_->Info();
  alive_at_ns_ = std::max(clock_.MonotonicNs(), info.begins_at_ns);
  SPDLOG_INFO("link {}: source started: {}", name_, info.description);
  const std::lock_guard lock(mutex_);
  condition_.info = std::move(info);
  condition_.counters = source_->Counters();
}

// What the source says of itself, for other threads.
void SourceSupervisor::Observe() {
  const SourceCounters counters = source_->Counters();
  const std::lock_guard lock(mutex_);
  if (counters.info_changes != condition_.counters.info_changes) condition_.info = source_->Info();
  condition_.counters = counters;
}

bool SourceSupervisor::TryNext(StereoFrame& frame, milliseconds timeout) {
  const auto result = Guarded([&] {
    const StageScope scope(mark_, WorkStage::kSourceNext, clock_);
    return source_->Next(frame, timeout);
  });
  Observe();
  if (result) {
    alive_at_ns_ = clock_.MonotonicNs();
    backoff_ = options_.first_backoff;  // only a frame proves that the source works
    frame.period_ns = FramesOr(milliseconds(0), 1);
    SetCondition(SourceCondition::State::kRunning, "");
    return true;
  }
  switch (result.error().code) {
    case ErrorCode::kTimeout: {
      const int64_t silent_ns = clock_.MonotonicNs() - alive_at_ns_;
      const int64_t stall_ns = FramesOr(options_.stall, 5);
      if (silent_ns >= stall_ns) {
        Failed({ErrorCode::kUnavailable, "no frame for " + std::to_string(stall_ns / 1'000'000'000) +
                                             " s: " + result.error().message});
      } else if (condition().state == SourceCondition::State::kRunning &&
                 silent_ns >= FramesOr(options_.silence, 3)) {
        SetCondition(SourceCondition::State::kLost, result.error().message + "; waiting");
      }
      break;
    }
    case ErrorCode::kEndOfData:
      started_ = false;
      SetCondition(SourceCondition::State::kEnded,
                   "the source has no more frames: " + result.error().message);
      break;
    default:
      Failed(result.error());
  }
  return false;
}

void SourceSupervisor::Failed(const Error& error) {
  started_ = false;
  retry_at_ns_ = clock_.MonotonicNs() + std::chrono::nanoseconds(backoff_).count();
  backoff_ = std::min(backoff_ * 2, options_.longest_backoff);
  SetCondition(SourceCondition::State::kLost, error.message + "; trying again");
}

int64_t SourceSupervisor::FramesOr(milliseconds least, double frames) const {
  const double rate_hz = condition().info.frame_rate_hz;
  return std::max(std::chrono::nanoseconds(least).count(),
                  rate_hz > 0 ? static_cast<int64_t>(frames * 1e9 / rate_hz) : 0);
}

void SourceSupervisor::SetCondition(SourceCondition::State state, std::string reason) {
  {
    const std::lock_guard lock(mutex_);
    if (condition_.state == state && condition_.reason == reason) return;
    condition_.state = state;
    condition_.reason = reason;
    ++condition_.changes;
  }
  if (state == SourceCondition::State::kRunning) {
    SPDLOG_INFO("link {}: frames arrive", name_);
  } else {
    SPDLOG_WARN("link {}: {}", name_, reason);
  }
}

Result<void> SourceSupervisor::SetCamera(CameraId id, const CameraSettings& settings) {
  if (!started_) return Error{ErrorCode::kUnavailable, "the link's cameras are not there now"};
  auto set = Guarded([&] { return source_->SetCamera(id, settings); });
  Observe();  // who is answered may ask at once
  return set;
}

SourceCondition SourceSupervisor::condition() const {
  const std::lock_guard lock(mutex_);
  return condition_;
}

}  // namespace taclink::server

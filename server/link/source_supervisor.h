#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "server/link/stage_mark.h"

namespace taclink::server {

struct SupervisorOptions {
  std::chrono::milliseconds first_backoff{100};
  std::chrono::milliseconds longest_backoff{500};
  /// A started source that gives nothing for this long (or for 5 frames of its rate) is started again.
  std::chrono::milliseconds stall{2000};
  /// One that gave frames and is silent for this long (or for 3 frames of its rate) is called lost.
  std::chrono::milliseconds silence{500};
};

/// How a source does, for those who report it.
struct SourceCondition {
  enum class State { kStarting, kRunning, kLost, kEnded };
  State state = State::kStarting;
  std::string reason;     ///< what failed and what happens next; empty while it runs
  uint64_t restarts = 0;  ///< attempts to start after the first
  uint64_t changes = 0;   ///< rises whenever state or reason change
  SourceInfo info;        ///< of the last good start, and what changed since
  SourceCounters counters;
};

/// Starts a source, starts it again with growing pauses when it fails, and knows what to say about it. An
/// error or exception of the source never leaves here.
class SourceSupervisor {
 public:
  SourceSupervisor(std::string name, std::unique_ptr<FrameSource> source, Clock& clock,
                   SupervisorOptions options = {}, StageMark* mark = nullptr);

  /// Does one thing that is due: starts the source, waits before the next attempt, or waits for a frame; for
  /// about `timeout` at most, as far as the source keeps to it. True: `frame` is filled. One thread.
  bool Next(StereoFrame& frame, std::chrono::milliseconds timeout);

  /// As FrameSource::SetCamera. Next's thread.
  Result<void> SetCamera(CameraId id, const CameraSettings& settings);

  /// Destroys the source, which closes its cameras. Next's thread, after which it makes no other call.
  void Close() { source_.reset(); }

  /// As FrameSource::WaitsForReader.
  bool WaitsForReader() const { return source_->WaitsForReader(); }

  SourceCondition condition() const;

 private:
  void Wait(int64_t until_ns, std::chrono::milliseconds timeout);
  void TryStart();
  bool TryNext(StereoFrame& frame, std::chrono::milliseconds timeout);
  void Failed(const Error& error);
  void Observe();
  void SetCondition(SourceCondition::State state, std::string reason);
  int64_t FramesOr(std::chrono::milliseconds least, double frames) const;

  // Constant after construction.
  const std::string name_;
  Clock& clock_;
  const SupervisorOptions options_;
  StageMark* const mark_;  // of Next's thread; null: nobody watches

  // Used by Next's thread only.
  std::unique_ptr<FrameSource> source_;
  bool started_ = false;
  bool ever_tried_ = false;
  int64_t retry_at_ns_ = 0;
  int64_t alive_at_ns_ = 0;  // last start or frame
  std::chrono::milliseconds backoff_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  SourceCondition condition_;
};

}  // namespace taclink::server

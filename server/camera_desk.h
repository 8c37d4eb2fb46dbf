#pragma once

#include <array>
#include <deque>
#include <functional>
#include <mutex>

#include "sensing/capture/frame_source.h"
#include "sensing/core/result.h"

namespace taclink::server {

class SourceSupervisor;

/// Which cameras of a link are to be set.
struct CameraOrder {
  std::array<bool, kCameraCount> cameras{};
  CameraSettings settings;
};

/// Called once, on the capture thread or that which gives it up.
using CameraObserver = std::function<void(const Result<void>&)>;

/// What a link's cameras were set to since the server started, for the source that follows. Any thread.
class CameraMemory {
 public:
  void Keep(const CameraOrder& order);
  /// Before the source is started.
  void Tell(FrameSource& source) const;

 private:
  mutable std::mutex mutex_;
  std::array<CameraSettings, kCameraCount> settings_;  // guarded by mutex_
};

/// Where settings of a link's cameras are ordered, and from where its capture thread carries them out.
class CameraDesk {
 public:
  /// Any thread. Errors: kUnavailable, kResourceExhausted (too many wait). All else is told to the observer.
  Result<void> Order(const CameraOrder& order, CameraObserver observer);

  /// On the capture thread, between two frames. Stops at the first camera that refuses.
  void CarryOut(SourceSupervisor& source);
  /// Any thread: the capture thread ends or hangs, and will not tell. No order is taken any more.
  void End(const Error& why);

 private:
  struct Job {
    CameraOrder order;
    CameraObserver observer;
  };

  std::mutex mutex_;
  // Guarded by mutex_.
  std::deque<Job> jobs_;  // the first may be under way; whoever takes one out tells its observer
  bool closed_ = false;
};

}  // namespace taclink::server

#pragma once

#include <array>
#include <mutex>

#include "sensing/capture/frame_source.h"

namespace taclink::server {

/// Which cameras of a link are to be set.
struct CameraOrder {
  std::array<bool, kCameraCount> cameras{};
  CameraSettings settings;
};

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

}  // namespace taclink::server

#include "server/link/camera_memory.h"

namespace taclink::server {

void CameraMemory::Keep(const CameraOrder& order) {
  const std::lock_guard lock(mutex_);
  for (const CameraId id : kBothCameras)
    if (order.cameras[Index(id)]) settings_[Index(id)].Take(order.settings);
}

void CameraMemory::Tell(FrameSource& source) const {
  const std::lock_guard lock(mutex_);
  for (const CameraId id : kBothCameras) source.Remember(id, settings_[Index(id)]);
}

}  // namespace taclink::server

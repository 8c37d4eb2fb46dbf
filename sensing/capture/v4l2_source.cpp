#include "sensing/capture/v4l2_source.h"

#include <utility>

#include "sensing/capture/camera_pair.h"
#include "sensing/capture/v4l2_camera.h"

namespace taclink {

std::unique_ptr<FrameSource> MakeV4l2Source(V4l2Options options, Clock& clock) {
  CameraPairOptions pair{.names = options.devices,
                         .width_px = options.width_px,
                         .height_px = options.height_px,
                         .frame_rate_hz = options.frame_rate_hz,
                         .buffers = options.buffers};
  return MakeCameraPair(std::move(pair), MakeV4l2CameraSystem(std::move(options), clock), clock);
}

}  // namespace taclink

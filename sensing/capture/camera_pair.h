#pragma once

#include <array>
#include <memory>
#include <string>

#include "sensing/capture/camera_device.h"
#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"

namespace taclink {

struct CameraPairOptions {
  std::array<std::string, kCameraCount> names;  ///< as configured, for messages
  int width_px = 0;
  int height_px = 0;
  double frame_rate_hz = 0;
  int buffers = 4;  ///< of each driver
};

/// Two cameras as one source: waits for both at once and pairs their pictures by the drivers' timestamps
/// (FramePairer says how). Each camera lives for itself. One that is unplugged, busy or silent is opened
/// again in the background, as often as it takes; meanwhile the frames have the other one's picture only.
/// Both gone: Next returns kUnavailable and Start is to be called.
std::unique_ptr<FrameSource> MakeCameraPair(CameraPairOptions options, std::unique_ptr<CameraSystem> system,
                                            Clock& clock);

}  // namespace taclink

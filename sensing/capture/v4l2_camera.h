#pragma once

#include <memory>

#include "sensing/capture/camera_device.h"
#include "sensing/capture/v4l2_source.h"
#include "sensing/core/clock.h"

namespace taclink {

/// The cameras of the options under Linux' V4L2, found by their names each time they are opened. Each opening
/// runs on a thread of its own, which may outlive the system where a camera hangs: `clock` lives as long as
/// the process.
std::unique_ptr<CameraSystem> MakeV4l2CameraSystem(V4l2Options options, Clock& clock);

}  // namespace taclink

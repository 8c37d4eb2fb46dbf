#pragma once

#include <memory>

#include "server/arm/arm_poses.h"
#include "server/attitude/attitude_source.h"
#include "server/config/config.h"

namespace taclink::server {

/// The configured source of a link's attitude. Not configured: where the images are simulated, the
/// simulation's; of a link that joints move, joint states; else the link never moves. `poses`: null without a
/// URDF; outlives it. `length_mm`: of the link.
std::unique_ptr<AttitudeSource> MakeAttitude(const Config& config, size_t link, ArmPoses* poses,
                                             double length_mm);

}  // namespace taclink::server

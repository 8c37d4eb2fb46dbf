#pragma once

#include <memory>

#include "server/arm/arm_poses.h"
#include "server/attitude/attitude_source.h"

namespace taclink::server {

/// Passes the joint positions of a simulated link's frames (StereoFrame::joint) on to the arm, so that it is
/// shown in the attitude in which the link is simulated; then applies `attitude`. A joint that the arm's URDF
/// lacks is ignored. `poses` outlives it.
std::unique_ptr<AttitudeSource> PassSimulatedJoints(ArmPoses& poses,
                                                    std::unique_ptr<AttitudeSource> attitude);

}  // namespace taclink::server

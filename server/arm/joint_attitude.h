#pragma once

#include <memory>

#include "server/arm/arm_poses.h"
#include "server/attitude/attitude_source.h"

namespace taclink::server {

struct JointAttitudeOptions {
  Vec3 gravity_mps2 = {0, 0, -9.80665};  ///< base frame
  double sigma_mps2 = kAttitudeSigmaMps2;
  Vec3 center_mm = Vec3::Zero();  ///< whose acceleration counts for the link; link frame
  double length_mm = 0;           ///< of the link, over which the acceleration varies
};

/// The specific force of a link by the arm's URDF and joint states: gravity in the link's frame, less the
/// acceleration of its center, by differences of its position over the last 0.1 s. Its uncertainty grows by a
/// third of that acceleration, whose newest part is not in it, by what varies along the link, and by how far
/// the link may have turned since the newest joint state. Unknown while joint states are missing or stale.
/// `poses` outlives it.
std::unique_ptr<AttitudeSource> MakeJointAttitude(const ArmPoses& poses, size_t link,
                                                  const JointAttitudeOptions& options);

}  // namespace taclink::server

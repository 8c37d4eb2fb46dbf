#pragma once

#include <memory>
#include <vector>

#include "sensing/core/clock.h"
#include "server/arm/arm.h"
#include "server/config/config.h"

namespace taclink::server {

/// What each configured link is made of, or why it can't be made. Errors name the link.
std::vector<Result<LinkParts>> BuildLinks(const Config& config, Clock& clock);

/// The links where the configuration has them on the arm. Errors name the link and the frame that is missing.
Result<std::unique_ptr<ArmPoses>> MakePoses(const Config& config,
                                            std::shared_ptr<const ArmKinematics> kinematics);

/// Null without a URDF: then the links' own poses are relative to the base. Errors: as ArmKinematics::Load
/// and MakePoses.
Result<std::unique_ptr<ArmPoses>> BuildPoses(const Config& config);

/// Builds the configured arm, not started. Errors name the link.
Result<std::unique_ptr<Arm>> BuildArm(const Config& config, Clock& clock);

}  // namespace taclink::server

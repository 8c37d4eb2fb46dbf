#pragma once

#include <cstdint>
#include <memory>

#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink::server {

/// Standard deviation of each component of a specific force whose source does not tell it, m/s^2: 1.2 degrees
/// of the mounting.
inline constexpr double kAttitudeSigmaMps2 = 0.2;

/// Says what the specific force in a link's frame is.
class AttitudeSource {
 public:
  virtual ~AttitudeSource() = default;

  /// Sets the frame's specific force at its exposure. Never waits. Of one thread.
  virtual void Apply(StereoFrame& frame) = 0;

  /// What a client says: m/s^2, link frame; `sigma_mps2` of each component, 0: as configured; `time_ns`
  /// monotonic. False: not newer than what is known. Errors: kFailedPrecondition (this source is no client),
  /// kInvalidArgument (no such specific force). Any thread.
  virtual Result<bool> Tell(const Vec3& mps2, double sigma_mps2, int64_t time_ns);
};

/// What the frames' source says (a simulation), or nothing: the link never moves.
std::unique_ptr<AttitudeSource> MakeSourceAttitude();
/// The link never moves, whatever the frames' source says.
std::unique_ptr<AttitudeSource> MakeFixedAttitude();
/// Always the same, m/s^2, link frame.
std::unique_ptr<AttitudeSource> MakeConstantAttitude(const Vec3& mps2, double sigma_mps2);
/// Nobody knows it: the skin tells it, frame by frame.
std::unique_ptr<AttitudeSource> MakeUnknownAttitude();

/// A specific force of which nothing is known; `trouble`: why, and what to do.
SpecificForceReading UnknownSpecificForce(AttitudeOrigin origin, std::string trouble = {});

}  // namespace taclink::server

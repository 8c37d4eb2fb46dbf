#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink::server {

class PressureController;

/// Says what the pressure inside a link's skin is.
class PressureSource {
 public:
  virtual ~PressureSource() = default;

  /// Begins and ends what it needs to know more.
  virtual void Start() {}
  virtual void Stop() {}

  /// Sets the frame's pressure at its exposure, and how it is known. Never waits.
  virtual void Apply(StereoFrame& frame) = 0;

  /// What a client says; `time_ns` monotonic. False: not newer than what is known. Errors:
  /// kFailedPrecondition (this source is no client), kInvalidArgument (no such pressure).
  virtual Result<bool> Tell(double mpa, int64_t time_ns);

  /// The controller of the regulator that sets this pressure; valid as long as this source. Errors:
  /// kFailedPrecondition (there is no regulator).
  virtual Result<PressureController*> Controller();
};

/// `mpa`: gauge pressure where the frames' source does not measure it; none: 0.
std::unique_ptr<PressureSource> MakeAssumedPressure(std::optional<double> mpa);

}  // namespace taclink::server

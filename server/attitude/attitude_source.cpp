#include "server/attitude/attitude_source.h"

#include <optional>
#include <string>
#include <utility>

#include "sensing/core/known_loads.h"

namespace taclink::server {
namespace {

class SourceAttitude final : public AttitudeSource {
 public:
  void Apply(StereoFrame&) override {}
};

/// Always the same; none: the link never moves.
class SameAttitude final : public AttitudeSource {
 public:
  explicit SameAttitude(std::optional<SpecificForceReading> reading) : reading_(std::move(reading)) {}
  void Apply(StereoFrame& frame) override { frame.specific_force = reading_; }

 private:
  const std::optional<SpecificForceReading> reading_;
};

}  // namespace

Result<bool> AttitudeSource::Tell(const Vec3&, double, int64_t) {
  return Error{ErrorCode::kFailedPrecondition,
               "the link's attitude does not come from clients; configure gravity: {source: grpc}"};
}

std::unique_ptr<AttitudeSource> MakeSourceAttitude() {
  return std::make_unique<SourceAttitude>();
}

std::unique_ptr<AttitudeSource> MakeFixedAttitude() {
  return std::make_unique<SameAttitude>(std::nullopt);
}

std::unique_ptr<AttitudeSource> MakeConstantAttitude(const Vec3& mps2, double sigma_mps2) {
  return std::make_unique<SameAttitude>(
      SpecificForceReading{.mps2 = mps2,
                           .covariance = sigma_mps2 * sigma_mps2 * Mat3::Identity(),
                           .origin = AttitudeOrigin::kConstant});
}

std::unique_ptr<AttitudeSource> MakeUnknownAttitude() {
  return std::make_unique<SameAttitude>(UnknownSpecificForce(AttitudeOrigin::kNone));
}

SpecificForceReading UnknownSpecificForce(AttitudeOrigin origin, std::string trouble) {
  MeasuredLoads loads;
  loads.ForgetAttitude();
  return {.mps2 = loads.specific_force_mps2,
          .covariance = loads.specific_force_covariance,
          .origin = origin,
          .trouble = std::move(trouble)};
}

}  // namespace taclink::server

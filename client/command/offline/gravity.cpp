#include "client/command/offline/gravity.h"

#include <cstdio>

namespace taclink::command {

Result<Vec3> SpecificForceFrom(const std::string& text) {
  Vec3 mps2 = Vec3::Zero();
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &mps2.x(), &mps2.y(), &mps2.z(), &used) != 3 ||
      static_cast<size_t>(used) != text.size() || !(mps2.norm() <= 100))
    return Error{ErrorCode::kInvalidArgument,
                 "'" + text + "' is not a specific force: give X,Y,Z in m/s^2, at most 100"};
  return mps2;
}

Result<void> TakeGravity(const std::string& text, double sigma_mps2, MeasuredLoads& loads) {
  if (text == "unknown") {
    loads.ForgetAttitude();
    return {};
  }
  const auto mps2 = SpecificForceFrom(text);
  if (!mps2) return Error{mps2.error().code, mps2.error().message + ", or 'unknown'"};
  loads.specific_force_mps2 = *mps2;
  loads.specific_force_covariance = sigma_mps2 * sigma_mps2 * Mat3::Identity();
  return {};
}

Result<void> CheckWeight(const LinkModel& model, const std::string& text) {
  if (!text.empty() && model.density_kg_m3 == 0)
    return Error{ErrorCode::kFailedPrecondition,
                 "model '" + model.name + "' has no skin.density_kg_m3, without which weight is not known"};
  return {};
}

}  // namespace taclink::command

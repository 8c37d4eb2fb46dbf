#include "sensing/simulation/handling.h"

#include <cmath>
#include <string>

#include "sensing/core/units.h"

namespace taclink {
namespace {

constexpr double kFingerMm = 16, kPlateMm = 40;
constexpr int kFingers = 4;
constexpr double kFingerPitchMm = 20;  // along the circumference, center to center
constexpr double kLeastDiameterMm = 2, kLargestDiameterMm = 60;
constexpr double kMostForceN = 20;
constexpr double kMostPressureKpa = 3;

Error Invalid(const std::string& what) {
  return {ErrorCode::kInvalidArgument, what};
}

std::string Text(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", number);
  return text;
}

Result<void> CheckBody(const LinkModel& model, const PressedBody& body) {
  if (body.id == 0) return Invalid("a body's id must not be 0");
  if (!std::isfinite(body.at.angle_rad)) return Invalid("the angle must be a finite number");
  if (!(body.at.z_mm > 0 && body.at.z_mm < model.length_mm))
    return Invalid("z must lie between the clamped ends, 0 and " + Text(model.length_mm) + " mm, and is " +
                   Text(body.at.z_mm) + " mm");
  const bool is_sized = body.shape == BodyShape::kSphere || body.shape == BodyShape::kDisc;
  if (is_sized && !(body.diameter_mm >= kLeastDiameterMm && body.diameter_mm <= kLargestDiameterMm))
    return Invalid("the diameter must be from " + Text(kLeastDiameterMm) + " to " + Text(kLargestDiameterMm) +
                   " mm, and is " + Text(body.diameter_mm) + " mm");
  if (body.depth_mm.has_value() == body.force_n.has_value())
    return Invalid("a body needs a depth or a force, and not both");
  const double most_mm = MostDepth(model, body.at);
  if (body.depth_mm && !(*body.depth_mm >= 0 && *body.depth_mm <= most_mm))
    return Invalid("the depth must be from 0 to " + Text(most_mm) + " mm there, and is " +
                   Text(*body.depth_mm) + " mm");
  if (body.force_n && !(*body.force_n > 0 && *body.force_n <= kMostForceN))
    return Invalid("the force must be above 0 and at most " + Text(kMostForceN) + " N, and is " +
                   Text(*body.force_n) + " N");
  return {};
}

}  // namespace

std::vector<BodyPart> PartsOf(const LinkModel& model, const PressedBody& body) {
  switch (body.shape) {
    case BodyShape::kFinger:
      return {{.diameter_mm = kFingerMm, .is_sphere = true}};
    case BodyShape::kSphere:
      return {{.diameter_mm = body.diameter_mm, .is_sphere = true}};
    case BodyShape::kDisc:
      return {{.diameter_mm = body.diameter_mm}};
    case BodyShape::kPlate:
      return {{.diameter_mm = kPlateMm}};
    case BodyShape::kHand:
      break;
  }
  const double pitch_rad =
      kFingerPitchMm / model.PointAtDepth(body.at.angle_rad, body.at.z_mm, 0).head<2>().norm();
  std::vector<BodyPart> parts;
  parts.reserve(kFingers + 1);
  for (int i = 0; i < kFingers; ++i)
    parts.push_back({.angle_rad = (i - (kFingers - 1) / 2.0) * pitch_rad,
                     .diameter_mm = kFingerMm,
                     .is_sphere = true,
                     .force_share = 0.5 / kFingers});
  parts.push_back({.angle_rad = kPi, .diameter_mm = kPlateMm, .force_share = 0.5});
  return parts;
}

Result<void> CheckHandling(const LinkModel& model, const Scene& scene, const Handling& handling) {
  if (scene.skin == SkinKind::kLinear && handling.any())
    return Error{ErrorCode::kFailedPrecondition,
                 "scene '" + scene.name + "' has a linear skin; only nonlinear ones can be handled"};
  size_t parts = 0;
  for (const PressedBody& body : handling.bodies) {
    if (auto good = CheckBody(model, body); !good) return good.error();
    parts += PartsOf(model, body).size();
  }
  if (parts > kMostBodyParts)
    return Invalid("too many bodies press on this skin; release one before another is pressed");
  if (handling.pressure_mpa &&
      !(*handling.pressure_mpa >= 0 && *handling.pressure_mpa <= kMpaPerKpa * kMostPressureKpa))
    return Invalid("the pressure must be from 0 to " + Text(kMostPressureKpa) + " kPa");
  if (handling.joint_rad && !(scene.motion && scene.motion->swing))
    return Error{ErrorCode::kFailedPrecondition,
                 "no joint moves this link in its scene '" + scene.name + "'"};
  if (handling.joint_rad && !std::isfinite(*handling.joint_rad))
    return Invalid("the joint's angle must be a finite number");
  return {};
}

}  // namespace taclink

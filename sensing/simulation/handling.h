#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/simulation/contact_plan.h"
#include "sensing/simulation/scene.h"

namespace taclink {

/// What a user presses on a simulated skin. All are rigid, and the skin slides on them without friction.
enum class BodyShape : uint8_t {
  kFinger,  ///< a sphere of 16 mm
  kSphere,
  kDisc,   ///< flat and round
  kPlate,  ///< a disc of 40 mm
  kHand,   ///< grips around the link: four fingers side by side, and opposite to them a plate
};

struct PressedBody {
  uint64_t id = 0;  ///< chosen by the user, not 0
  BodyShape shape = BodyShape::kFinger;
  double diameter_mm = 0;  ///< of a sphere or a disc; of other shapes it is not used
  SkinSpot at = {};
  // Exactly one of the two is set.
  std::optional<double> depth_mm = {};  ///< along the skin's inward normal, from where it first touches
  std::optional<double> force_n = {};   ///< along that normal; of a hand, the sum over its parts
};

/// All that a user does to a simulated link, over what its scene does.
struct Handling {
  std::vector<PressedBody> bodies = {};
  std::optional<double> pressure_mpa = {};  ///< none: the scene's
  double pressure_mpaps = 0;                ///< how fast pressure_mpa changes, MPa/s; 0: a pressure to go to
  std::optional<double> joint_rad = {};     ///< of the scene's swing; none: as the scene swings

  bool any() const { return !bodies.empty() || pressure_mpa || joint_rad; }
};

/// One rigid piece of a body, against where the body is.
struct BodyPart {
  double angle_rad = 0;  ///< further around the link
  double diameter_mm = 0;
  bool is_sphere = false;
  double force_share = 1;
};
std::vector<BodyPart> PartsOf(const LinkModel& model, const PressedBody& body);

inline constexpr size_t kMostBodyParts = 16;  ///< of all bodies on a skin together

/// Errors: kInvalidArgument (a body that is not on the skin, too large or too many; a depth, force or
/// pressure out of range), kFailedPrecondition (a joint of a scene that has none), with what is possible.
Result<void> CheckHandling(const LinkModel& model, const Scene& scene, const Handling& handling);

}  // namespace taclink

#pragma once

#include <span>
#include <vector>

#include "sensing/shell/disc_skin.h"
#include "sensing/simulation/handling.h"
#include "sensing/simulation/scene_motion.h"

namespace taclink {

/// A body on its way to where the user wants it.
struct MovingBody {
  PressedBody wanted;
  bool leaves = false;  ///< until it no longer touches
  SkinSpot at;
  double depth_mm = 0, force_n = 0;  ///< the one of the two that the user set
  std::vector<double>
      touching_mm;  ///< by part: its depth where it first touched, from the undeformed surface
};

/// What a user does to a skin at one moment: on its way, at speeds that an arm and a hand have, to what is
/// wanted.
struct HandledMotion {
  std::vector<MovingBody> bodies;
  double pressure_mpa = 0;
  JointMotion joint;
};

/// What is wanted at a moment: of what the user leaves to the scene, the scene's.
struct HandledGoal {
  double pressure_mpa = 0;
  JointMotion joint;
};

/// The motion some time later. Bodies that are not among the `wanted` ones, with that shape, leave.
HandledMotion MovedOn(const LinkModel& model, HandledMotion motion, const std::vector<PressedBody>& wanted,
                      const HandledGoal& goal, double span_s);

/// So far on the way from one to the other, which have the same bodies; 0 to 1.
HandledMotion Between(const HandledMotion& a, const HandledMotion& b, double share);

/// Writes the bodies' parts into discs, one after the other; `discs` has room for all.
void PlaceDiscs(const LinkModel& model, const HandledMotion& motion, std::span<SkinDisc> discs);

}  // namespace taclink

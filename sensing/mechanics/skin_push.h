#pragma once

#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink {

/// A flat, frictionless disc pressed radially against a marker's place.
struct SkinPush {
  int marker = 0;
  double depth_mm = 0;  ///< of the disc, from the uninflated radius
  double pressure_mpa = 0;
  double patch_diameter_mm = 5.5;
  int refinement = 1;  ///< of the marker grid; a mesh coarser than the disc is pushed at one node
  ForceModel force_model = ForceModel::kLinear;
};

struct SkinPushResult {
  double force_n = 0;       ///< on the disc, outwards; 0: the disc does not touch
  double inflation_mm = 0;  ///< of the marker's place without the disc, along the normal
  int nodes_in_contact = 0;
};

/// What a skin answers to a push; how a designer evaluates a skin.
/// Errors: kInvalidArgument (no such marker, not finite, deeper than the tube lets the skin go).
Result<SkinPushResult> PushSkin(const LinkModel& model, const SkinPush& push);

}  // namespace taclink

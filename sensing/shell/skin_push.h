#pragma once

#include <string>

#include "sensing/core/contact.h"
#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink {

/// A flat disc pressed radially against a marker's place. The nonlinear skin slides on it: three-dimensional
/// bricks need the same force within 0.6 % with and without friction (docs/reports/calculix.md).
struct SkinPush {
  int marker = 0;
  double depth_mm = 0;  ///< of the disc, from the uninflated radius
  double pressure_mpa = 0;
  /// Gravity less the link's acceleration, link frame; zero: weightless. Nothing to a model without density.
  Vec3 specific_force_mps2 = Vec3::Zero();
  double patch_diameter_mm = 5.5;
  /// Of the marker grid. A linear mesh coarser than the disc is pushed at one node.
  int refinement = 3;
  ForceModel force_model = ForceModel::kNonlinear;  ///< that or kLinear
};

struct SkinPushResult {
  double force_n = 0;        ///< on the disc, outwards; 0: the disc does not touch
  double inflation_mm = 0;   ///< of the marker's place without the disc, along the normal; with what sags
  int nodes_in_contact = 0;  ///< or points between them
  /// Nonlinear only: how far the wall under the disc gives way, mm; how the solution went.
  double indentation_mm = 0;
  std::string solution;
};

/// What a skin answers to a push; how a designer evaluates a skin.
/// Errors: kInvalidArgument (no such marker, not finite, deeper than the tube lets the skin go), kUnsupported
/// (another force model), kFailedPrecondition (no equilibrium was found: how far it went and why it stopped).
Result<SkinPushResult> PushSkin(const LinkModel& model, const SkinPush& push);

}  // namespace taclink

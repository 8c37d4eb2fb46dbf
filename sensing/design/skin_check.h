#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/design/findings.h"
#include "sensing/design/mechanics.h"
#include "sensing/design/resolution.h"
#include "sensing/design/visibility.h"

namespace taclink {

struct SkinCheckOptions {
  double pressure_mpa = 1.5e-3;             ///< the highest that the link is meant for; not negative
  Vec3 specific_force_mps2 = Vec3::Zero();  ///< link frame; zero: weightless but for the sag
  double marker_sigma_px = 0.3;             ///< of a marker's position in an image
  double least_marker_px = 3;               ///< across a marker in an image [duong2021, (3.3)]
  double least_force_n = 0.1;               ///< that the link is meant to feel everywhere
  double contact_diameter_mm = 5.5;         ///< of the smallest body that is meant to touch it
  /// Up to which limits of pressure are looked for at least; beyond the reserve over `pressure_mpa` in any
  /// case.
  double searched_pressure_mpa = 5e-3;
  /// False: what cameras see alone, at a small part of the cost. Forces, limits of pressure and weight are
  /// left out.
  bool with_mechanics = true;
};

/// One state of the skin: slack, or under the pressure and the specific force of the options.
struct DesignState {
  KnownLoads loads;
  SkinVisibility visibility;
  std::vector<MarkerResolution> resolutions;
  SkinForces forces;
};

/// Everything that is computed of a design before it is built.
struct SkinDesign {
  LinkModel model;
  SkinCheckOptions options;
  DesignState slack;
  std::optional<DesignState> loaded;  ///< none: without loads, or the skin does not stand them
  PressureLimits pressure;
  std::optional<WeightSag> sag;  ///< none: the model has no density
};

/// Computes a design's visibility, resolution and mechanics. `progress`: share of the work that is done.
/// Errors: kInvalidArgument (options that make no sense), kUnsupported (a skin that is not meshed in rings).
Result<SkinDesign> AnalyzeSkin(const LinkModel& model, const SkinCheckOptions& options,
                               const std::function<void(double)>& progress = {});

/// All that there is to say of it: faults first, then warnings, then notes.
std::vector<Finding> FindingsOf(const SkinDesign& design);

}  // namespace taclink

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
  double pressure_mpa = 1.5e-3;             ///< highest operating pressure; not negative
  Vec3 specific_force_mps2 = Vec3::Zero();  ///< link frame; zero: no weight, except for the sag
  double marker_sigma_px = 0.3;             ///< standard deviation of a marker's position in an image
  double least_marker_px = 3;               ///< smallest diameter of a marker in an image [duong2021, (3.3)]
  double least_force_n = 0.1;               ///< weakest force to be detected everywhere
  double contact_diameter_mm = 5.5;         ///< of the smallest body that touches the skin
  /// Limits of pressure are searched up to this, and at least to the reserve over `pressure_mpa`.
  double searched_pressure_mpa = 5e-3;
  /// False: only visibility and resolution, at a small part of the cost; no forces, limits of pressure or
  /// weight.
  bool with_mechanics = true;
};

/// One state of the skin: slack, or under the pressure and the specific force of the options.
struct DesignState {
  KnownLoads loads;
  SkinVisibility visibility;
  std::vector<MarkerResolution> resolutions;
  SkinForces forces;
};

/// Results of the analysis of a design.
struct SkinDesign {
  LinkModel model;
  SkinCheckOptions options;
  DesignState slack;
  std::optional<DesignState> loaded;  ///< none: no loads, or no stable equilibrium under them
  PressureLimits pressure;
  std::optional<WeightSag> sag;  ///< none: no density in the model, or no mechanics
};

/// Computes a design's visibility, resolution and mechanics. `progress`: finished share of the work. Errors:
/// kInvalidArgument (options out of range), kUnsupported (a skin that is not meshed in rings).
Result<SkinDesign> AnalyzeSkin(const LinkModel& model, const SkinCheckOptions& options,
                               const std::function<void(double)>& progress = {});

/// All findings: faults first, then warnings, then notes.
std::vector<Finding> FindingsOf(const SkinDesign& design);

}  // namespace taclink

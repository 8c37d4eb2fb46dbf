#include "sensing/design/skin_check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/design/skin_geometry.h"
#include "sensing/shell/ring_stiffness.h"

namespace taclink {
namespace {

constexpr double kMostMpa = 0.02, kMostMps2 = 100;
constexpr double kBeyondReserve = 1.1 * kPressureReserve;

Result<void> CheckOptions(const SkinCheckOptions& options) {
  if (!(options.pressure_mpa >= 0 && options.pressure_mpa <= kMostMpa))
    return Error{ErrorCode::kInvalidArgument, "the pressure must be from 0 to 20 kPa"};
  if (!(options.specific_force_mps2.norm() <= kMostMps2))
    return Error{ErrorCode::kInvalidArgument, "the specific force must be at most 100 m/s^2"};
  for (const double positive : {options.marker_sigma_px, options.least_marker_px, options.least_force_n,
                                options.contact_diameter_mm, options.searched_pressure_mpa}) {
    if (!(positive > 0 && std::isfinite(positive)))
      return Error{ErrorCode::kInvalidArgument,
                   "noise, limits, contact and searched pressure must be positive and finite"};
  }
  return {};
}

DesignState StateOf(const LinkModel& model, const SkinGeometry& geometry, const KnownLoads& loads,
                    const SkinCheckOptions& options) {
  DesignState state;
  state.loads = loads;
  state.visibility = FindVisibility(model, geometry);
  state.resolutions = FindResolution(model, geometry, state.visibility, options.marker_sigma_px);
  return state;
}

}  // namespace

Result<SkinDesign> AnalyzeSkin(const LinkModel& model, const SkinCheckOptions& options,
                               const std::function<void(double)>& progress) {
  if (auto good = CheckOptions(options); !good) return good.error();
  const auto done = [&](double share) {
    if (progress) progress(share);
  };
  SkinEstimator estimator(model);
  SkinMechanics& mechanics = estimator.mechanics();
  if (!RingBlocks::Fit(mechanics.shell()))
    return Error{ErrorCode::kUnsupported, "model '" + model.name + "' is not meshed in rings"};
  SkinDesign design{.model = model, .options = options, .slack = {}, .loaded = {}, .pressure = {}, .sag = {}};
  design.slack = StateOf(model, RestGeometry(model), {}, options);
  done(0.1);
  if (options.with_mechanics)
    design.slack.forces = FindForces(estimator, {}, design.slack.resolutions, options.contact_diameter_mm);
  done(0.4);
  const KnownLoads loads{options.pressure_mpa, options.specific_force_mps2};
  const UntouchedSkin* untouched = loads == KnownLoads{} ? nullptr : mechanics.Untouched(loads);
  if (untouched != nullptr) {
    design.loaded =
        StateOf(model, DeformedGeometry(model, mechanics.mesh(), untouched->state), loads, options);
    if (options.with_mechanics)
      design.loaded->forces =
          FindForces(estimator, loads, design.loaded->resolutions, options.contact_diameter_mm);
  }
  done(0.8);
  if (!options.with_mechanics) return design;
  design.pressure = FindPressureLimits(
      mechanics.shell(), std::max(options.searched_pressure_mpa, kBeyondReserve * options.pressure_mpa));
  done(0.9);
  design.sag = FindWeightSag(mechanics, 0);
  done(1);
  return design;
}

std::vector<Finding> FindingsOf(const SkinDesign& design) {
  std::vector<Finding> all;
  for (auto* concern : {&GeometryFindings, &CameraFindings, &SightFindings, &MechanicsFindings}) {
    for (Finding& finding : (*concern)(design)) all.push_back(std::move(finding));
  }
  std::ranges::stable_sort(all, std::greater(), &Finding::severity);
  return all;
}

}  // namespace taclink

#include "sensing/design/mechanics.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"
#include "sensing/shell/inflated_skin.h"
#include "sensing/shell/skin_push.h"

namespace taclink {
namespace {

constexpr int kScan = 20;                   // steps from zero to the highest pressure
constexpr int kBisections = 7;              // halvings of one step
constexpr double kMostGrowth = 0.5;         // of the radius
constexpr double kPressureSigmaMpa = 5e-5;  // as the server assumes for a pressure sensor
// A mesh that is coarser along the axis overestimates forces beside a clamp by a quarter.
constexpr int kPushRefinement = 1, kPushRefinementAlong = 2;
constexpr double kPushStepMm = 3;                                               // in length units
constexpr std::array<double, 6> kDepthShares = {0.15, 0.3, 0.45, 0.6, 0.8, 1};  // of the distance to the tube

bool Stands(const NonlinearShell& shell, double pressure_mpa) {
  const auto skin = Inflate(shell, pressure_mpa);
  if (!skin) return false;
  const std::vector<Vec3>& rest_mm = shell.surface().mids_mm;
  for (size_t i = 0; i < rest_mm.size(); ++i) {
    const double radius = rest_mm[i].head<2>().norm();
    if (std::abs(skin->state.mids_mm[i].head<2>().norm() - radius) > kMostGrowth * radius) return false;
  }
  return true;
}

// Scans from zero pressure to the first failure, then bisects that step.
std::optional<double> FirstLost(const NonlinearShell& shell, double most_mpa) {
  double stands = 0;
  for (int i = 1; i <= kScan; ++i) {
    double fails = most_mpa * i / kScan;
    if (Stands(shell, fails)) {
      stands = fails;
      continue;
    }
    for (int j = 0; j < kBisections; ++j) {
      const double middle = (stands + fails) / 2;
      (Stands(shell, middle) ? stands : fails) = middle;
    }
    return fails;
  }
  return std::nullopt;
}

double LongestOutward(const LinkModel& model, const Eigen::VectorXd& markers_mm) {
  double longest = 0;
  for (int m = 0; m < model.markers.count(); ++m) {
    const Vec3 rest = model.RestMarker(m);
    const Vec3 now = rest + markers_mm.segment<3>(3 * m);
    longest = std::max(longest, now.head<2>().norm() - rest.head<2>().norm());
  }
  return longest;
}

// The largest limit over the ring's row of sites.
void WriteLeastForces(const SkinMechanics& mechanics, const DetectionLimits& limits, SkinForces& forces) {
  const int along = mechanics.mesh().refinement_along, columns = mechanics.columns();
  for (size_t ring = 0; ring < forces.by_ring.size(); ++ring) {
    const auto row = (static_cast<Eigen::Index>(ring) + 1) * along - 1;
    const double most = limits.by_site_n.segment(row * columns, columns).maxCoeff();
    if (std::isfinite(most)) forces.by_ring[ring].least_n = most;
  }
}

void FindLeastForces(SkinEstimator& estimator, const std::vector<MarkerResolution>& resolutions,
                     SkinForces& forces) {
  SkinObservation observation;
  observation.loads = {.pressure_mpa = forces.loads.pressure_mpa,
                       .pressure_sigma_mpa = kPressureSigmaMpa,
                       .specific_force_mps2 = forces.loads.specific_force_mps2};
  observation.baseline_loads = observation.loads;
  for (size_t m = 0; m < resolutions.size(); ++m) {
    observation.markers.displacement_mm.emplace_back(Vec3::Zero());
    observation.markers.information.push_back(resolutions[m].information);
  }
  SkinEstimate estimate;
  estimator.Restart();
  estimator.Estimate(observation, estimate);
  if (estimate.failure != EstimateFailure::kNone) {
    forces.problem =
        "the least detectable force is not known: the estimator finds no answer for the untouched "
        "skin, as too few markers are seen";
    return;
  }
  WriteLeastForces(estimator.mechanics(), estimator.Limits(), forces);
}

// The ring with the same response, if the skin is symmetric about mid-length; else `ring` itself.
int MirroredRing(const LinkModel& model, int ring) {
  constexpr int kSamples = 32;
  constexpr double kAlike = 1e-6;  // of the length
  const auto& z = model.markers.rings_z_mm;
  for (int i = 0; i <= kSamples; ++i) {
    const double at = model.length_mm * i / (2 * kSamples);
    if (std::abs(model.profile.Radius(at) - model.profile.Radius(model.length_mm - at)) >
        kAlike * model.length_mm)
      return ring;
  }
  for (size_t i = 0; i < z.size(); ++i) {
    if (std::abs(z[i] + z[z.size() - 1 - i] - model.length_mm) > kAlike * model.length_mm) return ring;
  }
  return model.markers.rings() - 1 - ring;
}

// Until the force falls or the last depth is reached. The range counts from the surface under the loads.
void FindRange(const LinkModel& model, LoadedSkin& skin, int ring, double disc_diameter_mm,
               RingForce& force) {
  const int marker = model.MarkerIndex(0, ring);
  const double inflation_mm = skin.InflationMm(marker);
  const double most_mm = force.room_mm + inflation_mm;
  if (!(most_mm > 0)) return;
  std::vector<double> depths_mm;
  for (const double share : kDepthShares) depths_mm.push_back(share * most_mm - inflation_mm);
  const std::vector<SkinPushResult> pushed = skin.PushAsFar(marker, depths_mm, disc_diameter_mm).results;
  for (size_t i = 0; i < pushed.size(); ++i) {
    if (i > 0 && pushed[i].force_n < pushed[i - 1].force_n) {
      force.end = RingForce::End::kSnap;
      return;
    }
    force.range_mm = depths_mm[i] + inflation_mm;
    force.range_n = pushed[i].force_n;
  }
  if (pushed.size() == depths_mm.size()) force.end = RingForce::End::kTube;
}

}  // namespace

const char* Name(Attitude attitude) {
  switch (attitude) {
    case Attitude::kUpright:
      return "upright";
    case Attitude::kHanging:
      return "hanging";
    case Attitude::kLying:
      return "lying";
  }
  return "";
}

Vec3 WeightDirection(Attitude attitude) {
  switch (attitude) {
    case Attitude::kUpright:
      return Vec3::UnitZ();
    case Attitude::kHanging:
      return -Vec3::UnitZ();
    case Attitude::kLying:
      return -Vec3::UnitY();
  }
  return Vec3::Zero();
}

PressureLimits FindPressureLimits(const NonlinearShell& shell, double most_mpa) {
  return {.searched_mpa = most_mpa,
          .buckles_mpa = FirstLost(shell, -most_mpa),
          .runs_away_mpa = FirstLost(shell, most_mpa)};
}

std::optional<WeightSag> FindWeightSag(SkinMechanics& mechanics, double pressure_mpa) {
  const LinkModel& model = mechanics.model();
  if (model.density_kg_m3 == 0) return std::nullopt;
  WeightSag sag;
  for (const double area_mm2 : mechanics.mesh().areas_mm2) sag.mass_kg += model.MassPerArea() * area_mm2;
  const UntouchedSkin* weightless = mechanics.Untouched({pressure_mpa, Vec3::Zero()});
  if (weightless == nullptr) return sag;
  const Eigen::VectorXd before_mm = weightless->markers_mm;  // `weightless` is valid until the next call
  for (const Attitude attitude : kAttitudes) {
    const UntouchedSkin* skin =
        mechanics.Untouched({pressure_mpa, kStandardGravity * WeightDirection(attitude)});
    if (skin == nullptr) continue;
    double longest = 0;
    for (int m = 0; m < mechanics.marker_count(); ++m)
      longest = std::max(longest, (skin->markers_mm - before_mm).segment<3>(3 * m).norm());
    sag.sag_mm[static_cast<size_t>(attitude)] = longest;
  }
  return sag;
}

SkinForces FindForces(SkinEstimator& estimator, const KnownLoads& loads,
                      const std::vector<MarkerResolution>& resolutions, double disc_diameter_mm) {
  SkinForces forces{.loads = loads, .growth_mm = 0, .by_ring = {}, .problem = std::nullopt};
  SkinMechanics& mechanics = estimator.mechanics();
  const LinkModel& model = mechanics.model();
  const UntouchedSkin* untouched = mechanics.Untouched(loads);
  if (untouched == nullptr) {
    forces.problem = "the skin has no stable equilibrium clear of the tube under these loads";
    return forces;
  }
  forces.growth_mm = LongestOutward(model, untouched->markers_mm);
  forces.by_ring.resize(static_cast<size_t>(model.markers.rings()));
  FindLeastForces(estimator, resolutions, forces);
  auto skin = LoadedSkin::Make(model, loads,
                               {.refinement = kPushRefinement,
                                .refinement_along = kPushRefinementAlong,
                                .step_mm = kPushStepMm * LengthUnit(model)});
  for (int ring = 0; ring < model.markers.rings(); ++ring) {
    RingForce& force = forces.by_ring[static_cast<size_t>(ring)];
    force.room_mm = RoomBehindMm(model, model.MarkerIndex(0, ring)) - model.markers.diameter_mm / 2;
    const int mirrored = loads.specific_force_mps2.isZero(0) ? MirroredRing(model, ring) : ring;
    if (mirrored < ring) {
      const RingForce& same = forces.by_ring[static_cast<size_t>(mirrored)];
      force.range_mm = same.range_mm;
      force.range_n = same.range_n;
      force.end = same.end;
    } else if (skin) {
      FindRange(model, *skin, ring, disc_diameter_mm, force);
    }
  }
  if (!skin && !forces.problem) forces.problem = "the working range is not known: " + skin.error().message;
  return forces;
}

}  // namespace taclink

// Findings about pressure, weight and forces.
#include <algorithm>
#include <cmath>

#include "sensing/design/design_text.h"
#include "sensing/design/findings.h"
#include "sensing/design/skin_check.h"

namespace taclink {
namespace {

constexpr double kKpaPerMpa = 1e3;
constexpr double kSensorScatterMpa = 5e-5;  // scatter of pressure readings at zero
constexpr double kFelt = 3;                 // sag that is noticeable, in standard deviations of a marker

void AddPressureLimits(const SkinDesign& design, std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  const double searched = design.pressure.searched_mpa * kKpaPerMpa;
  const double wanted = design.options.pressure_mpa * kKpaPerMpa;
  Finding away{.severity = Severity::kNote, .id = "pressure_limit"};
  away.unit = "kPa";
  if (const auto& limit_mpa = design.pressure.runs_away_mpa) {
    const double limit = *limit_mpa * kKpaPerMpa;
    away.value = limit;
    away.limit = kPressureReserve * wanted;
    away.what = "the skin runs away at about " + Digits(limit) + " kPa";
    if (limit < kPressureReserve * wanted) {
      away.severity = limit <= wanted ? Severity::kFault : Severity::kWarning;
      away.what +=
          limit <= wanted ? ", within its working range of " : ", hardly beyond its working range of ";
      away.what += Digits(wanted) + " kPa";
      // For a membrane this pressure is proportional to E t / R.
      const double factor = kPressureReserve * wanted / limit;
      away.change = "a wall of at least " + Decimals(factor * model.thickness_mm) +
                    " mm, or a modulus of at least " + Digits(factor * model.material.youngs_modulus_mpa) +
                    " MPa";
    }
  } else {
    away.limit = searched;
    away.what = "the skin is stable up to " + Digits(searched) + " kPa at least";
  }
  findings.push_back(std::move(away));
  Finding buckles{.severity = Severity::kNote, .id = "buckling_pressure"};
  buckles.unit = "kPa";
  if (const auto& limit_mpa = design.pressure.buckles_mpa) {
    const double limit = *limit_mpa * kKpaPerMpa;
    buckles.value = limit;
    buckles.limit = -kSensorScatterMpa * kKpaPerMpa;
    buckles.what = "the skin buckles at a suction of about " + Digits(-limit) + " kPa";
    if (-*limit_mpa < kSensorScatterMpa) {
      buckles.severity = Severity::kWarning;
      buckles.what += ", within the scatter of a pressure sensor about zero";
      buckles.change = "some pressure inside, always";
    }
  } else {
    buckles.what = "the skin does not buckle down to a suction of " + Digits(searched) + " kPa";
  }
  findings.push_back(std::move(buckles));
}

std::string StateText(const SkinForces& forces) {
  return forces.loads == KnownLoads{} ? "slack"
                                      : "at " + Digits(forces.loads.pressure_mpa * kKpaPerMpa) + " kPa";
}

void AddLeastForce(const SkinDesign& design, const SkinForces& forces, std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  int worst = -1, weak = 0;
  double most_n = 0;
  for (size_t ring = 0; ring < forces.by_ring.size(); ++ring) {
    const auto& least_n = forces.by_ring[ring].least_n;
    if (!least_n) continue;
    weak += *least_n > design.options.least_force_n ? 1 : 0;
    if (worst >= 0 && *least_n <= most_n) continue;
    worst = static_cast<int>(ring);
    most_n = *least_n;
  }
  if (worst < 0) return;
  // A slack skin is the most sensitive: a force that it does not detect is never detected.
  const bool is_slack = forces.loads == KnownLoads{};
  Finding finding{.severity = weak == 0  ? Severity::kNote
                              : is_slack ? Severity::kFault
                                         : Severity::kWarning,
                  .id = "least_force"};
  finding.value = most_n;
  finding.limit = design.options.least_force_n;
  finding.unit = "N";
  finding.markers = weak * model.markers.paths;
  finding.what = "the least force that is detected " + StateText(forces) + " is " + Digits(most_n, 2) +
                 " N, at ring " + std::to_string(worst + 1);
  if (weak > 0) {
    finding.what += ": more than the " + Digits(design.options.least_force_n) + " N that are wanted, at " +
                    std::to_string(weak) + " of " + std::to_string(model.markers.rings()) + " rings";
    // The force of a small dent is proportional to E t^2.
    const double factor = design.options.least_force_n / most_n;
    finding.change = "a wall of at most " + Decimals(model.thickness_mm * std::sqrt(factor)) +
                     " mm, or a modulus of at most " + Digits(model.material.youngs_modulus_mpa * factor) +
                     " MPa";
    if (!is_slack) finding.change += ", or less pressure";
    // Beside a clamp the skin moves little, however thin it is.
    if (weak <= 2 && (worst == 0 || worst + 1 == model.markers.rings()))
      finding.change = "that ring further from the clamped end; or " + finding.change;
  }
  findings.push_back(AtMarker(model, model.MarkerIndex(0, worst), std::move(finding)));
}

void AddRange(const SkinDesign& design, const SkinForces& forces, std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  int worst = -1;
  double least_mm = 0;
  for (size_t ring = 0; ring < forces.by_ring.size(); ++ring) {
    if (!forces.by_ring[ring].range_mm) continue;  // not solved: unknown
    const double mm = *forces.by_ring[ring].range_mm;
    if (worst >= 0 && mm >= least_mm) continue;
    worst = static_cast<int>(ring);
    least_mm = mm;
  }
  if (worst < 0) return;
  const RingForce& at = forces.by_ring[static_cast<size_t>(worst)];
  Finding finding{.severity = least_mm < model.thickness_mm ? Severity::kWarning : Severity::kNote,
                  .id = "working_range"};
  finding.value = least_mm;
  finding.limit = model.thickness_mm;
  finding.unit = "mm";
  finding.what = "the shortest working range " + StateText(forces) + " is " + Decimals(least_mm) +
                 " mm, at ring " + std::to_string(worst + 1);
  using End = RingForce::End;
  if (at.range_n)
    finding.what += ", where " + Digits(*at.range_n, 2) + " N " +
                    (at.end == End::kTube   ? "press a marker against the tube"
                     : at.end == End::kSnap ? "are the most before the dent snaps"
                                            : "press as far as an equilibrium was found");
  if (finding.severity == Severity::kWarning && at.end != End::kNotSolved)
    finding.change =
        at.end == End::kTube ? "a thinner tube or a wider skin" : "more pressure or a thicker wall";
  findings.push_back(AtMarker(model, model.MarkerIndex(0, worst), std::move(finding)));
}

void AddForces(const SkinDesign& design, const SkinForces& forces, std::vector<Finding>& findings) {
  if (forces.problem) {
    Finding finding{.severity = forces.by_ring.empty() ? Severity::kFault : Severity::kWarning,
                    .id = forces.by_ring.empty() ? "no_equilibrium" : "forces_not_computed"};
    finding.what = StateText(forces) + ": " + *forces.problem;
    findings.push_back(std::move(finding));
  }
  AddLeastForce(design, forces, findings);
  AddRange(design, forces, findings);
}

// The largest standard deviation of a marker that both cameras see.
double MarkerSigmaMm(const DesignState& state) {
  double most = 0;
  for (const MarkerResolution& marker : state.resolutions) {
    if (marker.sigmas_mm && marker.sigmas_mm->allFinite())
      most = std::max(most, marker.sigmas_mm->maxCoeff());
  }
  return most;
}

void AddWeight(const SkinDesign& design, std::vector<Finding>& findings) {
  if (!design.sag) {
    Finding finding{.severity = Severity::kNote, .id = "weight_not_computed"};
    finding.what = "weight and sag are not computed: the model has no skin.density_kg_m3";
    findings.push_back(std::move(finding));
    return;
  }
  Finding weight{.severity = Severity::kNote, .id = "weight"};
  weight.value = design.sag->mass_kg * kStandardGravity;
  weight.unit = "N";
  weight.what = "the skin weighs " + Digits(design.sag->mass_kg) + " kg, " + Digits(*weight.value) + " N";
  findings.push_back(std::move(weight));
  const double sigma_mm = MarkerSigmaMm(design.slack);
  for (const Attitude attitude : kAttitudes) {
    const auto& sag_mm = design.sag->sag_mm[static_cast<size_t>(attitude)];
    Finding finding{.severity = Severity::kNote, .id = "sag"};
    finding.unit = "mm";
    if (!sag_mm) {
      finding.severity = Severity::kWarning;
      finding.what = std::string("slack and ") + Name(attitude) +
                     ", the skin does not carry its weight clear of the tube";
      finding.change = "pressure inside wherever it is used so, or a thicker or stiffer wall";
    } else {
      finding.value = *sag_mm;
      finding.limit = kFelt * sigma_mm;
      finding.what = std::string(Name(attitude)) + ", the slack skin sags by " + Decimals(*sag_mm, 2) + " mm";
      if (sigma_mm > 0) {
        finding.what +=
            ", " + Digits(*sag_mm / sigma_mm, 2) + " times the most uncertain marker's standard deviation";
        if (*sag_mm > kFelt * sigma_mm)
          finding.change =
              "let the server know the link's attitude, or take the baseline in the attitude of use";
      }
    }
    findings.push_back(std::move(finding));
  }
}

}  // namespace

std::vector<Finding> MechanicsFindings(const SkinDesign& design) {
  std::vector<Finding> findings;
  if (!design.options.with_mechanics) return findings;
  AddPressureLimits(design, findings);
  AddForces(design, design.slack.forces, findings);
  if (design.loaded) {
    AddForces(design, design.loaded->forces, findings);
    Finding growth{.severity = Severity::kNote, .id = "growth"};
    growth.value = design.loaded->forces.growth_mm;
    growth.unit = "mm";
    growth.what =
        "the skin grows by up to " + Decimals(*growth.value, 2) + " mm " + StateText(design.loaded->forces);
    findings.push_back(std::move(growth));
  } else if (!(KnownLoads{design.options.pressure_mpa, design.options.specific_force_mps2} == KnownLoads{})) {
    Finding finding{.severity = Severity::kFault, .id = "no_equilibrium"};
    finding.value = design.options.pressure_mpa * kKpaPerMpa;
    finding.unit = "kPa";
    finding.what = "the skin has no stable equilibrium clear of the tube at " +
                   Digits(design.options.pressure_mpa * kKpaPerMpa) + " kPa";
    finding.change = "less pressure, or a thicker or stiffer wall";
    findings.push_back(std::move(finding));
  }
  AddWeight(design, findings);
  return findings;
}

}  // namespace taclink

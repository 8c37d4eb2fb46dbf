// Findings about the geometry of the skin, its markers and its tube.
#include <algorithm>
#include <cmath>
#include <limits>

#include "sensing/core/similar_skin.h"
#include "sensing/design/design_text.h"
#include "sensing/design/findings.h"
#include "sensing/design/skin_check.h"
#include "sensing/design/skin_geometry.h"

namespace taclink {
namespace {

// Range of thickness over radius in which the shell was verified (docs/reports/stability.md).
constexpr double kThinnest = 1e-3, kThickest = 0.2;
constexpr double kMarkerRoom = 1.15;   // diameters between two markers' centers that a mould needs
constexpr double kCenterSlack = 0.25;  // diameters between center_depth_mm and a dome's centroid, at most
constexpr double kClampShare = 0.5;    // of the decay length; a marker nearer to a clamp hardly moves

double MidRadius(const LinkModel& model, double z_mm) {
  return model.PointAtDepth(0, z_mm, model.thickness_mm / 2).x();
}

void AddThickness(const LinkModel& model, std::vector<Finding>& findings) {
  double thickest = 0, at_mm = 0;
  for (int i = 0; i <= 64; ++i) {
    const double z = model.length_mm * i / 64, ratio = model.thickness_mm / MidRadius(model, z);
    if (ratio > thickest) {
      thickest = ratio;
      at_mm = z;
    }
  }
  Finding finding{.severity = Severity::kWarning, .id = "thickness_ratio"};
  finding.z_mm = at_mm;
  finding.value = thickest;
  if (thickest > kThickest) {
    finding.limit = kThickest;
    finding.what = "the wall is " + Digits(thickest) + " of its radius at z = " + Decimals(at_mm) +
                   " mm, thicker than the shell model was verified for (" + Digits(kThickest) + ")";
    finding.change = "a wall of at most " + Decimals(kThickest * MidRadius(model, at_mm)) + " mm there";
  } else if (thickest < kThinnest) {
    finding.limit = kThinnest;
    finding.what = "the wall is " + Digits(thickest) +
                   " of its radius, thinner than the shell model was verified for (" + Digits(kThinnest) +
                   ")";
    finding.change = "a wall of at least " + Digits(kThinnest * MidRadius(model, at_mm)) + " mm";
  } else {
    return;
  }
  findings.push_back(std::move(finding));
}

// From the distances of the feet on the wall: domes of two markers must not touch.
void AddOverlaps(const LinkModel& model, const SkinGeometry& rest, std::vector<Finding>& findings) {
  const int paths = model.markers.paths, rings = model.markers.rings();
  double nearest = std::numeric_limits<double>::infinity();
  int at = 0, count = 0;
  bool is_around = true;
  for (int ring = 0; ring < rings; ++ring) {
    const int marker = model.MarkerIndex(0, ring);
    const auto consider = [&](int other, bool around) {
      const double mm =
          (rest.feet[static_cast<size_t>(marker)] - rest.feet[static_cast<size_t>(other)]).norm();
      if (mm < kMarkerRoom * model.markers.diameter_mm) count += paths;
      if (mm >= nearest) return;
      nearest = mm;
      at = marker;
      is_around = around;
    };
    consider(model.MarkerIndex(1 % paths, ring), true);
    if (ring + 1 < rings) consider(model.MarkerIndex(0, ring + 1), false);
  }
  if (count == 0) return;
  const double diameter = model.markers.diameter_mm;
  Finding finding{.severity = nearest < diameter ? Severity::kFault : Severity::kWarning,
                  .id = "markers_overlap"};
  finding.markers = std::min(count, model.markers.count());
  finding.value = nearest;
  finding.limit = diameter;
  finding.unit = "mm";
  finding.what = std::string("neighboring markers ") + (is_around ? "of a ring" : "of a path") + " are " +
                 Decimals(nearest, 2) + " mm apart, " +
                 (nearest < diameter ? "less than" : "hardly more than") + " their diameter of " +
                 Digits(diameter) + " mm";
  finding.change = "a marker diameter of at most " + Decimals(nearest / kMarkerRoom, 2) + " mm";
  if (is_around) {
    const double radius = rest.feet[static_cast<size_t>(at)].head<2>().norm();
    const double most = kPi / std::asin(std::min(1.0, kMarkerRoom * diameter / (2 * radius)));
    finding.change += ", or at most " + std::to_string(static_cast<int>(most)) + " paths";
  }
  findings.push_back(AtMarker(model, at, std::move(finding)));
}

void AddClampedRings(const LinkModel& model, std::vector<Finding>& findings) {
  const double radius_mm = model.markers.diameter_mm / 2;
  for (const int ring : {0, model.markers.rings() - 1}) {
    const double z = model.markers.rings_z_mm[static_cast<size_t>(ring)];
    const double off_mm = std::min(z, model.length_mm - z);
    const double still_mm = kClampShare * std::sqrt(MidRadius(model, z) * model.thickness_mm);
    if (off_mm >= std::max(radius_mm, still_mm)) continue;
    const bool is_clamped = off_mm < radius_mm;
    Finding finding{.severity = is_clamped ? Severity::kFault : Severity::kWarning, .id = "ring_at_clamp"};
    finding.markers = model.markers.paths;
    finding.value = off_mm;
    finding.limit = is_clamped ? radius_mm : still_mm;
    finding.unit = "mm";
    finding.what =
        "ring " + std::to_string(ring + 1) + " is " + Decimals(off_mm) + " mm from the clamped end, " +
        (is_clamped
             ? "so that its markers reach into the clamp"
             : "where the skin hardly moves: it moves over about " + Decimals(still_mm) + " mm and more");
    finding.change = "a ring at least " + Decimals(std::max(radius_mm, still_mm)) + " mm from the end";
    findings.push_back(AtMarker(model, model.MarkerIndex(0, ring), std::move(finding)));
  }
}

void AddCenterDepth(const LinkModel& model, std::vector<Finding>& findings) {
  const double dome_mm = model.thickness_mm + 2 * model.markers.diameter_mm / (3 * kPi);
  if (std::abs(model.markers.center_depth_mm - dome_mm) <= kCenterSlack * model.markers.diameter_mm) return;
  Finding finding{.severity = Severity::kWarning, .id = "marker_center_depth"};
  finding.value = model.markers.center_depth_mm;
  finding.limit = dome_mm;
  finding.unit = "mm";
  finding.what = "markers.center_depth_mm is " + Digits(model.markers.center_depth_mm) +
                 " mm, but domes of that diameter on the inner wall have their centroid at " +
                 Decimals(dome_mm, 2) + " mm";
  finding.change = "center_depth_mm: " + Decimals(dome_mm, 2) + ", or no such key";
  findings.push_back(std::move(finding));
}

void AddTubeClearance(const LinkModel& model, const SkinDesign& design, std::vector<Finding>& findings) {
  if (design.slack.forces.by_ring.empty()) return;
  const auto& rings = design.slack.forces.by_ring;
  const auto least = std::ranges::min_element(rings, {}, &RingForce::room_mm);
  const auto ring = static_cast<int>(least - rings.begin());
  if (least->room_mm >= model.thickness_mm) return;
  Finding finding{.severity = least->room_mm <= 0 ? Severity::kFault : Severity::kWarning,
                  .id = "tube_clearance"};
  finding.value = least->room_mm;
  finding.limit = model.thickness_mm;
  finding.unit = "mm";
  finding.markers = model.markers.paths;
  finding.what = "the markers of ring " + std::to_string(ring + 1) + " are " + Decimals(least->room_mm) +
                 " mm from the tube" + (least->room_mm <= 0 ? ": they stand in it" : "");
  finding.change = "a tube of at most " +
                   Decimals(model.tube_outer_radius_mm + least->room_mm - model.thickness_mm) +
                   " mm outer radius";
  findings.push_back(AtMarker(model, model.MarkerIndex(0, ring), std::move(finding)));
}

// A dent decays over sqrt(R t) on either side of the contact; markers further apart may miss it.
void AddSpacing(const LinkModel& model, double contact_mm, std::vector<Finding>& findings) {
  const auto& z = model.markers.rings_z_mm;
  struct Widest {
    double excess = 0, pitch_mm = 0, dent_mm = 0;
    int ring = -1;
  } along, around;
  for (size_t ring = 0; ring < z.size(); ++ring) {
    const double dent_mm = contact_mm + 2 * std::sqrt(MidRadius(model, z[ring]) * model.thickness_mm);
    const auto consider = [&](double pitch_mm, Widest& widest) {
      if (pitch_mm - dent_mm > widest.excess)
        widest = {pitch_mm - dent_mm, pitch_mm, dent_mm, static_cast<int>(ring)};
    };
    consider(MidRadius(model, z[ring]) * model.markers.path_pitch_rad(), around);
    if (ring + 1 < z.size()) consider(z[ring + 1] - z[ring], along);
  }
  for (const auto& [widest, is_around] : {std::pair(along, false), {around, true}}) {
    if (widest.ring < 0) continue;
    Finding finding{.severity = Severity::kWarning, .id = "markers_far_apart"};
    finding.value = widest.pitch_mm;
    finding.limit = widest.dent_mm;
    finding.unit = "mm";
    finding.what = std::string("markers are ") + Decimals(widest.pitch_mm) + " mm apart " +
                   (is_around ? "around" : "along") + " the skin, more than the " + Decimals(widest.dent_mm) +
                   " mm over which a contact of " + Digits(contact_mm) +
                   " mm dents it: one between them may be missed";
    finding.change = is_around ? "at least " +
                                     std::to_string(static_cast<int>(
                                         std::ceil(model.markers.paths * widest.pitch_mm / widest.dent_mm))) +
                                     " paths"
                               : "rings at most " + Decimals(widest.dent_mm) + " mm apart";
    findings.push_back(AtMarker(model, model.MarkerIndex(0, widest.ring), std::move(finding)));
  }
}

}  // namespace

std::vector<Finding> GeometryFindings(const SkinDesign& design) {
  const LinkModel& model = design.model;
  std::vector<Finding> findings;
  AddThickness(model, findings);
  AddOverlaps(model, RestGeometry(model), findings);
  AddClampedRings(model, findings);
  AddCenterDepth(model, findings);
  AddTubeClearance(model, design, findings);
  AddSpacing(model, design.options.contact_diameter_mm, findings);
  return findings;
}

}  // namespace taclink

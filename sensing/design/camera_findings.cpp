// Findings about the cameras' positions and viewing directions.
#include <algorithm>
#include <cmath>

#include "sensing/design/design_text.h"
#include "sensing/design/findings.h"
#include "sensing/design/skin_check.h"

namespace taclink {
namespace {

constexpr double kWrongWayDeg = 90, kTiltedDeg = 15;

struct CameraPlace {
  CameraId id;
  Vec3 at = Vec3::Zero(), forward = Vec3::Zero();
  double off_axis_mm = 0;
  double outside_mm = 0;  // distance beyond its own end of the skin; negative: inside
};

CameraPlace PlaceOf(const LinkModel& model, CameraId id) {
  const Rigid3 link_from_camera = model.nominal_rig[id].camera_from_link.Inverse();
  CameraPlace place{.id = id};
  place.at = link_from_camera.translation;
  place.forward = link_from_camera.rotation.col(2);
  place.off_axis_mm = place.at.head<2>().norm();
  place.outside_mm = id == CameraId::kTop ? -place.at.z() : place.at.z() - model.length_mm;
  return place;
}

std::string CameraName(CameraId id) {
  return std::string("the ") + Name(id) + " camera";
}

void AddDirection(const LinkModel& model, const CameraPlace& place, std::vector<Finding>& findings) {
  const Vec3 to_middle = (Vec3(0, 0, model.length_mm / 2) - place.at).normalized();
  const double off_deg = DegFromRad(std::acos(std::clamp(to_middle.dot(place.forward), -1.0, 1.0)));
  if (!(off_deg > kTiltedDeg)) return;
  Finding finding{.severity = off_deg > kWrongWayDeg ? Severity::kFault : Severity::kWarning,
                  .id = "camera_direction"};
  finding.z_mm = place.at.z();
  finding.value = off_deg;
  finding.limit = off_deg > kWrongWayDeg ? kWrongWayDeg : kTiltedDeg;
  finding.unit = "deg";
  finding.what = CameraName(place.id) +
                 (off_deg > kWrongWayDeg ? " looks away from the skin: " : " is tilted: ") +
                 Decimals(off_deg, 0) + " degrees off the direction to the skin's middle";
  finding.change = std::string("cameras.") + Name(place.id) + ".rotation_deg: [0, 0, 0]";
  findings.push_back(std::move(finding));
}

void AddSide(const LinkModel& model, const CameraPlace& place, std::vector<Finding>& findings) {
  if (place.outside_mm >= -model.length_mm / 2) return;
  Finding finding{.severity = Severity::kFault, .id = "camera_at_wrong_end"};
  finding.z_mm = place.at.z();
  finding.value = place.at.z();
  finding.limit = model.length_mm / 2;
  finding.unit = "mm";
  finding.what =
      CameraName(place.id) + " is at z = " + Decimals(place.at.z()) + " mm, at the other camera's end";
  finding.change = std::string("swap the cameras' places: top stands before z = 0, bottom behind z = ") +
                   Digits(model.length_mm, 4);
  findings.push_back(std::move(finding));
}

// A camera inside the skin: in the wall, in the cavity, or in the tube.
void AddInside(const LinkModel& model, const CameraPlace& place, std::vector<Finding>& findings) {
  const double z = place.at.z();
  if (!(z > 0 && z < model.length_mm)) return;
  const double wall_mm = model.PointAtDepth(0, z, model.thickness_mm).x();
  const bool in_wall = place.off_axis_mm >= wall_mm;
  const bool in_cavity =
      !in_wall && model.tube_outer_radius_mm > 0 && place.off_axis_mm > model.tube_outer_radius_mm;
  int behind = 0;
  for (const double ring_z : model.markers.rings_z_mm)
    behind += (Vec3(0, 0, ring_z) - place.at).z() * place.forward.z() <= 0 ? 1 : 0;
  Finding finding{.severity = in_wall || in_cavity || behind > 0 ? Severity::kFault : Severity::kWarning,
                  .id = "camera_inside_skin"};
  finding.z_mm = z;
  finding.value = -place.outside_mm;
  finding.limit = 0;
  finding.unit = "mm";
  finding.markers = behind * model.markers.paths;
  finding.what = CameraName(place.id) + " is " + Decimals(-place.outside_mm) + " mm inside the skin" +
                 (in_wall     ? ", in its wall"
                  : in_cavity ? ", between the tube and the skin"
                              : "") +
                 (behind > 0 ? ", and " + std::to_string(behind) + " rings are behind it" : "");
  finding.change = "place it at least " + Decimals(-place.outside_mm) + " mm further out";
  findings.push_back(std::move(finding));
}

}  // namespace

std::vector<Finding> CameraFindings(const SkinDesign& design) {
  std::vector<Finding> findings;
  for (const CameraId id : kBothCameras) {
    const CameraPlace place = PlaceOf(design.model, id);
    AddDirection(design.model, place, findings);
    AddSide(design.model, place, findings);
    AddInside(design.model, place, findings);
  }
  return findings;
}

}  // namespace taclink

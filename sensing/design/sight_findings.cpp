// Findings about the visibility of the markers and the accuracy of their positions.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "sensing/camera/projection.h"
#include "sensing/design/design_text.h"
#include "sensing/design/findings.h"
#include "sensing/design/skin_check.h"
#include "sensing/design/skin_geometry.h"

namespace taclink {
namespace {

constexpr double kSmallGapPx = 1;                  // outlines that are closer merge with noise and blur
constexpr double kFlatPx = 1;                      // shorter side of a marker, at least
constexpr double kCoarseShare = 0.3;               // standard deviation of a marker, over the thickness
constexpr double kGrazingShare = 0.25;             // clearance, over the height of a dome's centroid
constexpr double kCentroidHeight = 2 / (3 * kPi);  // of a dome, over its diameter
constexpr double kFurthestOut = 0.5;               // largest shift of a camera, over the skin's length
constexpr int kShiftBisections = 8;

// Markers that one camera does not see, for one reason.
struct SightGroup {
  std::vector<int> markers;
  bool is_whole_ring = false;  // a whole ring is among them
  bool is_unseen = false;      // a marker that the other camera does not see either is among them
};

SightGroup GroupOf(const LinkModel& model, const SkinVisibility& visibility, CameraId id, Sight sight) {
  SightGroup group;
  std::map<int, int> by_ring;
  const auto& views = visibility[id];
  for (int m = 0; m < model.markers.count(); ++m) {
    if (views[static_cast<size_t>(m)].sight != sight) continue;
    group.markers.push_back(m);
    group.is_whole_ring = group.is_whole_ring || ++by_ring[model.RingOf(m)] == model.markers.paths;
    group.is_unseen = group.is_unseen || visibility.SeenBy(m) == 0;
  }
  return group;
}

std::string RingsText(const LinkModel& model, const std::vector<int>& markers) {
  std::set<int> rings;
  for (const int m : markers) rings.insert(model.RingOf(m) + 1);
  if (rings.size() == 1) return "ring " + std::to_string(*rings.begin());
  return "rings " + std::to_string(*rings.begin()) + " to " + std::to_string(*rings.rbegin());
}

const char* IdOf(Sight sight) {
  switch (sight) {
    case Sight::kTurnedAway:
      return "marker_turned_away";
    case Sight::kOutsideLens:
      return "marker_outside_lens";
    case Sight::kOutsideImage:
      return "marker_outside_image";
    case Sight::kBehindWall:
      return "marker_behind_wall";
    case Sight::kBehindTube:
      return "marker_behind_tube";
    case Sight::kBehindMarker:
      return "marker_behind_marker";
    case Sight::kSeen:
      break;
  }
  return "";
}

// Outward shift of a camera that brings all of these into its image; none: no shift does.
std::optional<double> ShiftToSee(const LinkModel& model, CameraId id, const std::vector<int>& markers) {
  const SkinGeometry rest = RestGeometry(model);
  const auto helps = [&](double mm) {
    CameraModel camera = model.nominal_rig[id];
    const Vec3 at = camera.camera_from_link.Inverse().translation;
    const Vec3 moved = at + Vec3(0, 0, id == CameraId::kTop ? -mm : mm);
    camera.camera_from_link.translation = -(camera.camera_from_link.rotation * moved);
    const auto views = ViewsOf(model, rest, camera);
    return std::ranges::all_of(markers, [&](int m) { return views[static_cast<size_t>(m)].is_seen(); });
  };
  double high = kFurthestOut * model.length_mm, low = 0;
  if (!helps(high)) return std::nullopt;
  for (int i = 0; i < kShiftBisections; ++i) {
    const double middle = (low + high) / 2;
    (helps(middle) ? high : low) = middle;
  }
  return high;
}

// The largest tube whose block leaves the lines of sight to these markers free.
double TubeToSee(const LinkModel& model, CameraId id, const std::vector<int>& markers) {
  const Projector camera(model.nominal_rig[id]);
  const SkinGeometry rest = RestGeometry(model);
  double least = model.tube_outer_radius_mm;
  for (const int m : markers) {
    const Vec3 at = rest.OnDome(m, kCentroidHeight * model.markers.diameter_mm),
               eye = camera.center_in_link();
    const double share = (model.length_mm / 2 - at.z()) / (eye.z() - at.z());
    least = std::min(least, (at + share * (eye - at)).head<2>().norm());
  }
  return least;
}

std::string ChangeFor(const LinkModel& model, CameraId id, Sight sight, const std::vector<int>& markers) {
  switch (sight) {
    case Sight::kOutsideLens:
    case Sight::kOutsideImage: {
      const auto shift = ShiftToSee(model, id, markers);
      return shift ? "place the " + std::string(Name(id)) + " camera " + Decimals(*shift) +
                         " mm further out, or take a wider lens"
                   : "a wider lens, or a camera that stands and looks right";
    }
    case Sight::kBehindTube:
      return "a tube of at most " + Decimals(TubeToSee(model, id, markers)) + " mm outer radius";
    case Sight::kBehindWall:
      return "a profile that narrows less towards the " + std::string(Name(id)) + " camera";
    case Sight::kBehindMarker:
      return "smaller markers, or rings further apart";
    default:
      return "a wall that is less steep there";
  }
}

std::string LoadsText(const DesignState& state) {
  return state.loads == KnownLoads{} ? "" : " under " + Digits(state.loads.pressure_mpa * 1e3) + " kPa";
}

// `before`: the slack skin; only what is worse than there is reported.
void AddUnseen(const SkinDesign& design, const DesignState& state, const DesignState* before,
               std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  for (const CameraId id : kBothCameras) {
    for (const Sight sight : {Sight::kTurnedAway, Sight::kOutsideLens, Sight::kOutsideImage,
                              Sight::kBehindWall, Sight::kBehindTube, Sight::kBehindMarker}) {
      const SightGroup group = GroupOf(model, state.visibility, id, sight);
      if (group.markers.empty()) continue;
      if (before != nullptr &&
          GroupOf(model, before->visibility, id, sight).markers.size() >= group.markers.size())
        continue;
      Finding finding{
          .severity = group.is_whole_ring || group.is_unseen ? Severity::kFault : Severity::kWarning,
          .id = IdOf(sight)};
      finding.markers = static_cast<int>(group.markers.size());
      finding.value = finding.markers;
      finding.limit = 0;
      finding.unit = "markers";
      finding.what = std::to_string(finding.markers) + " markers (" + RingsText(model, group.markers) +
                     ") are " + Name(sight) + " of the " + Name(id) + " camera" + LoadsText(state) +
                     (group.is_unseen       ? "; some are seen by no camera"
                      : group.is_whole_ring ? "; of a whole ring no depth is measured"
                                            : "");
      finding.change = ChangeFor(model, id, sight, group.markers);
      findings.push_back(AtMarker(model, group.markers.front(), std::move(finding)));
    }
  }
}

void AddSizes(const SkinDesign& design, CameraId id, std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  const auto& views = design.slack.visibility[id];
  int smallest = -1, flattest = -1, too_small = 0, flat = 0;
  for (int m = 0; m < model.markers.count(); ++m) {
    const MarkerView& view = views[static_cast<size_t>(m)];
    if (!view.is_seen()) continue;
    if (smallest < 0 || view.larger_px() < views[static_cast<size_t>(smallest)].larger_px()) smallest = m;
    if (flattest < 0 || view.smaller_px() < views[static_cast<size_t>(flattest)].smaller_px()) flattest = m;
    too_small += view.larger_px() < design.options.least_marker_px ? 1 : 0;
    flat += view.smaller_px() < kFlatPx ? 1 : 0;
  }
  if (smallest < 0) return;
  const double size = views[static_cast<size_t>(smallest)].larger_px(),
               least = design.options.least_marker_px;
  Finding finding{.severity = too_small > 0 ? Severity::kFault : Severity::kNote,
                  .id = too_small > 0 ? "marker_too_small" : "smallest_marker"};
  finding.markers = too_small;
  finding.value = size;
  finding.limit = least;
  finding.unit = "px";
  finding.what = std::string("the smallest marker of the ") + Name(id) + " camera's image is " +
                 Decimals(size, 2) + " x " + Decimals(views[static_cast<size_t>(smallest)].smaller_px(), 2) +
                 " px; " + Digits(least) + " px across are needed";
  if (too_small > 0) {
    // The size is proportional to the diameter, and inversely to the distance along the axis.
    const double z = model.markers.rings_z_mm[static_cast<size_t>(model.RingOf(smallest))];
    const double camera_z = model.nominal_rig[id].camera_from_link.Inverse().translation.z();
    const double shorter = std::abs(z - camera_z) * (1 - size / least);
    finding.change = "a marker diameter of at least " +
                     Decimals(std::ceil(10 * model.markers.diameter_mm * least / size) / 10) +
                     " mm, or a length of at most " + Decimals(model.length_mm - shorter, 0) +
                     " mm with the rings moved along";
  }
  findings.push_back(AtMarker(model, smallest, std::move(finding)));
  if (flat == 0) return;
  Finding seen_flat{.severity = Severity::kWarning, .id = "marker_seen_flat"};
  seen_flat.markers = flat;
  seen_flat.value = views[static_cast<size_t>(flattest)].smaller_px();
  seen_flat.limit = kFlatPx;
  seen_flat.unit = "px";
  seen_flat.what = std::to_string(flat) + " markers are seen at so flat an angle by the " + Name(id) +
                   " camera that they are down to " + Decimals(*seen_flat.value, 2) + " px high";
  seen_flat.change = "higher or larger markers";
  findings.push_back(AtMarker(model, flattest, std::move(seen_flat)));
}

void AddGaps(const SkinDesign& design, const DesignState& state, const DesignState* before,
             std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  for (const CameraId id : kBothCameras) {
    const auto near = [&](const DesignState& of) {
      std::vector<int> markers;
      for (int m = 0; m < model.markers.count(); ++m) {
        const MarkerView& view = of.visibility[id][static_cast<size_t>(m)];
        if (view.is_seen() && view.gap_px < kSmallGapPx) markers.push_back(m);
      }
      return markers;
    };
    const std::vector<int> markers = near(state);
    if (markers.empty() || (before != nullptr && near(*before).size() >= markers.size())) continue;
    const auto& views = state.visibility[id];
    const int worst =
        *std::ranges::min_element(markers, {}, [&](int m) { return views[static_cast<size_t>(m)].gap_px; });
    const double gap = views[static_cast<size_t>(worst)].gap_px;
    Finding finding{.severity = gap < 0 ? Severity::kFault : Severity::kWarning, .id = "markers_merge"};
    finding.markers = static_cast<int>(markers.size());
    finding.value = gap;
    finding.limit = gap < 0 ? 0 : kSmallGapPx;
    finding.unit = "px";
    finding.what = std::to_string(finding.markers) + " markers (" + RingsText(model, markers) + ") " +
                   (gap < 0 ? "overlap their neighbors by " : "are hardly apart from their neighbors, by ") +
                   Decimals(std::abs(gap), 2) + " px, in the " + Name(id) + " camera's image" +
                   LoadsText(state);
    finding.change = "rings or paths further apart, or smaller markers";
    findings.push_back(AtMarker(model, worst, std::move(finding)));
  }
}

void AddGrazing(const SkinDesign& design, std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  const double limit_mm = kGrazingShare * kCentroidHeight * model.markers.diameter_mm;
  for (const CameraId id : kBothCameras) {
    const auto& views = design.slack.visibility[id];
    int worst = -1, count = 0;
    for (int m = 0; m < model.markers.count(); ++m) {
      const MarkerView& view = views[static_cast<size_t>(m)];
      if (!view.is_seen() || view.clearance_mm >= limit_mm) continue;
      ++count;
      if (worst < 0 || view.clearance_mm < views[static_cast<size_t>(worst)].clearance_mm) worst = m;
    }
    if (worst < 0) continue;
    Finding finding{.severity = Severity::kWarning, .id = "sight_grazes_wall"};
    finding.markers = count;
    finding.value = views[static_cast<size_t>(worst)].clearance_mm;
    finding.limit = limit_mm;
    finding.unit = "mm";
    finding.what = "the " + std::string(Name(id)) + " camera's lines of sight to " + std::to_string(count) +
                   " markers pass the wall by " + Decimals(*finding.value, 2) + " mm and less than " +
                   Decimals(limit_mm, 2) + " mm: a shallow dent hides them";
    finding.change = "a profile that narrows less towards that camera, or larger markers";
    findings.push_back(AtMarker(model, worst, std::move(finding)));
  }
}

void AddMargins(const SkinDesign& design, CameraId id, std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  int worst = -1;
  const auto& views = design.slack.visibility[id];
  for (int m = 0; m < model.markers.count(); ++m) {
    const auto i = static_cast<size_t>(m);
    if (views[i].is_seen() && (worst < 0 || views[i].margin_px < views[static_cast<size_t>(worst)].margin_px))
      worst = m;
  }
  if (worst < 0) return;
  Finding finding{.severity = Severity::kNote, .id = "field_of_view_margin"};
  finding.value = views[static_cast<size_t>(worst)].margin_px;
  finding.limit = 0;
  finding.unit = "px";
  finding.what = std::string("the outermost whole marker of the ") + Name(id) + " camera's image is " +
                 Decimals(*finding.value) + " px from the image's edge";
  findings.push_back(AtMarker(model, worst, std::move(finding)));
}

// Only for each camera's own end: the far end is seen, or hidden, which is another finding.
void AddBlindZones(const SkinDesign& design, std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  const SkinVisibility& seen = design.slack.visibility;
  for (const CameraId id : kBothCameras) {
    const bool is_top = id == CameraId::kTop;
    const double blind_mm = is_top ? seen.blind[Index(id)].top_mm : seen.blind[Index(id)].bottom_mm;
    std::vector<int> within;
    bool is_whole_ring = false;
    for (int ring = 0; ring < model.markers.rings(); ++ring) {
      const double z = model.markers.rings_z_mm[static_cast<size_t>(ring)];
      if ((is_top ? z : model.length_mm - z) >= blind_mm) continue;
      int hidden = 0;
      for (int path = 0; path < model.markers.paths; ++path) {
        const int m = model.MarkerIndex(path, ring);
        if (seen[id][static_cast<size_t>(m)].is_seen()) continue;
        within.push_back(m);
        ++hidden;
      }
      is_whole_ring = is_whole_ring || hidden == model.markers.paths;
    }
    Finding finding{.severity = is_whole_ring    ? Severity::kFault
                                : within.empty() ? Severity::kNote
                                                 : Severity::kWarning,
                    .id = "blind_zone"};
    finding.z_mm = is_top ? blind_mm : model.length_mm - blind_mm;
    finding.markers = static_cast<int>(within.size());
    finding.value = blind_mm;
    finding.unit = "mm";
    finding.what = std::string("the ") + Name(id) + " camera does not see the first " + Decimals(blind_mm) +
                   " mm of the wall at its end on all sides";
    if (!within.empty()) {
      finding.what += "; " + std::to_string(within.size()) + " markers of " + RingsText(model, within) +
                      " are there unseen";
      finding.change = ChangeFor(model, id, Sight::kOutsideImage, within);
    }
    findings.push_back(std::move(finding));
  }
  const double both_mm = std::max(seen.blind_to_both.top_mm, seen.blind_to_both.bottom_mm);
  if (both_mm <= 0) return;
  Finding finding{.severity = Severity::kNote, .id = "blind_to_both"};
  finding.value = both_mm;
  finding.unit = "mm";
  finding.z_mm = seen.blind_to_both.top_mm >= both_mm ? both_mm : model.length_mm - both_mm;
  finding.what = "no camera sees the first " + Decimals(both_mm) + " mm of the wall at an end on all sides";
  findings.push_back(std::move(finding));
}

void AddResolution(const SkinDesign& design, const DesignState& state, std::vector<Finding>& findings) {
  const LinkModel& model = design.model;
  constexpr const char* kAxes[] = {"R", "phi", "Z"};
  int worst = -1, axis = 0;
  double worst_mm = 0;
  for (int m = 0; m < model.markers.count(); ++m) {
    const auto& sigmas = state.resolutions[static_cast<size_t>(m)].sigmas_mm;
    if (!sigmas) continue;
    Eigen::Index at = 0;
    const double mm = sigmas->maxCoeff(&at);
    if (worst >= 0 && mm <= worst_mm) continue;
    worst = m;
    worst_mm = mm;
    axis = static_cast<int>(at);
  }
  if (worst < 0) return;
  const double limit_mm = kCoarseShare * model.thickness_mm;
  Finding finding{.severity = worst_mm > limit_mm ? Severity::kWarning : Severity::kNote,
                  .id = "marker_uncertainty"};
  finding.value = worst_mm;
  finding.limit = limit_mm;
  finding.unit = "mm";
  finding.what = "a marker's place is uncertain by up to " + Decimals(worst_mm, 2) +
                 " mm (standard deviation of " + kAxes[axis] + ", " + Digits(design.options.marker_sigma_px) +
                 " px in the images)" + LoadsText(state);
  if (worst_mm > limit_mm)
    finding.change = "more pixels or a longer focal length, a shorter skin, or a wider one";
  findings.push_back(AtMarker(model, worst, std::move(finding)));
}

}  // namespace

std::vector<Finding> SightFindings(const SkinDesign& design) {
  std::vector<Finding> findings;
  const DesignState* loaded = design.loaded ? &*design.loaded : nullptr;
  AddUnseen(design, design.slack, nullptr, findings);
  if (loaded != nullptr) AddUnseen(design, *loaded, &design.slack, findings);
  for (const CameraId id : kBothCameras) AddSizes(design, id, findings);
  AddGaps(design, design.slack, nullptr, findings);
  if (loaded != nullptr) AddGaps(design, *loaded, &design.slack, findings);
  AddGrazing(design, findings);
  AddBlindZones(design, findings);
  for (const CameraId id : kBothCameras) AddMargins(design, id, findings);
  AddResolution(design, design.slack, findings);
  if (loaded != nullptr) AddResolution(design, *loaded, findings);
  return findings;
}

}  // namespace taclink

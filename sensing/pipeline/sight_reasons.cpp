#include "sensing/pipeline/sight_reasons.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sensing/core/similar_skin.h"
#include "sensing/pipeline/reason_text.h"

namespace taclink {
namespace {

// Markers in sight so far apart, in sqrt(R t), over which a dent decays: forces between them were wrong.
constexpr double kWidestGap = 3.5;
// Depth of a dent by how far along the link it hides the markers: bodies of 5 to 40 mm, pressed in by 14 to
// 20 mm, hide 40 to 60 mm, and their forces are right within 4 %. What covers a lens, or a lamp that is out,
// hides as much over dents of 10 mm at most.
constexpr double kShadowSlope = 0.25;
constexpr int kLeftOutTogether = 3;     // of a marker and its neighbors
constexpr double kLeftOutShare = 0.04;  // of all labels

// A marker of that ring is seen on the path or on one of so many beside it.
bool IsSeenNear(const LinkModel& model, const SkinShape& shape, int path, int ring, int beside) {
  const int paths = model.markers.paths;
  for (int p = path - beside; p <= path + beside; ++p) {
    const auto marker = static_cast<size_t>(model.MarkerIndex((p % paths + paths) % paths, ring));
    if (shape.sources[marker] != MarkerSource::kInferred) return true;
  }
  return false;
}

struct Gap {
  int path = 0;
  double begin_mm = 0, end_mm = 0;
  double length_mm() const { return end_mm - begin_mm; }
};

// A body hides the wall behind its own dent from the cameras where that is steep: what is out of sight there
// belongs to the dent.
bool IsShadowOfDent(const Evidence& evidence, const Gap& gap) {
  const MarkerGrid& grid = evidence.model.markers;
  double deepest_mm = 0;
  for (int ring = 0; ring < grid.rings(); ++ring) {
    const double z_mm = grid.rings_z_mm[static_cast<size_t>(ring)];
    if (z_mm > gap.begin_mm && z_mm < gap.end_mm)
      deepest_mm = std::max(deepest_mm, DentAt(evidence, evidence.model.MarkerIndex(gap.path, ring)));
  }
  return deepest_mm > kShadowSlope * gap.length_mm();
}

// Along the link, the clamped ends included, where no marker is in sight for half of `wide_mm` to either
// side.
Gap WidestGap(const Evidence& evidence, const SkinShape& shape, double wide_mm) {
  const LinkModel& model = evidence.model;
  Gap widest;
  const auto& rings_mm = model.markers.rings_z_mm;
  const int unlike_paths = shape.seen() == model.markers.count() ? 1 : model.markers.paths;
  for (int path = 0; path < unlike_paths; ++path) {
    double begin_mm = 0;
    for (int ring = 0; ring <= model.markers.rings(); ++ring) {
      const bool is_end = ring == model.markers.rings();
      const double at_mm = is_end ? model.length_mm : rings_mm[static_cast<size_t>(ring)];
      if (!is_end) {
        const double pitch_mm =
            model.RestMarker(model.MarkerIndex(path, ring)).head<2>().norm() * model.markers.path_pitch_rad();
        if (!IsSeenNear(model, shape, path, ring, static_cast<int>(wide_mm / 2 / pitch_mm))) continue;
      }
      const Gap gap{path, begin_mm, at_mm};
      if (gap.length_mm() > widest.length_mm() &&
          !(gap.length_mm() > wide_mm && IsShadowOfDent(evidence, gap)))
        widest = gap;
      begin_mm = at_mm;
    }
  }
  return widest;
}

// The most labels that were left out among a marker and its eight neighbors.
int MostLeftOut(const LinkModel& model, const SkinShape& shape) {
  if (shape.rejected.empty()) return 0;
  const int paths = model.markers.paths, rings = model.markers.rings();
  std::vector<char> out(static_cast<size_t>(model.markers.count()), 0);
  for (const RejectedMarker& rejected : shape.rejected) out[static_cast<size_t>(rejected.marker)] = 1;
  int most = 0;
  for (const RejectedMarker& rejected : shape.rejected) {
    int count = 0;
    for (int r = -1; r <= 1; ++r) {
      const int ring = model.RingOf(rejected.marker) + r;
      if (ring < 0 || ring >= rings) continue;
      for (int p = -1; p <= 1; ++p)
        count += out[static_cast<size_t>(
            model.MarkerIndex((model.PathOf(rejected.marker) + p + paths) % paths, ring))];
    }
    most = std::max(most, count);
  }
  return most;
}

// A contact beyond the first or the last ring that is seen on a path, or on it, for of a body there half is
// beyond, or no further inside than its center may be off; or one that is wider along the link than rings are
// apart and reaches such a ring: of plates whose edge is 2 mm from a clamp, up to a half was not found.
bool IsBeyondMarkersOf(const LinkModel& model, const SkinShape& shape, int path, const Contact& contact) {
  int first = 0, last = model.markers.rings() - 1;
  while (first <= last && !IsSeenNear(model, shape, path, first, 1)) ++first;
  while (first < last && !IsSeenNear(model, shape, path, last, 1)) --last;
  if (first >= last) return true;
  const auto& rings_mm = model.markers.rings_z_mm;
  const double sigma_mm =
      contact.center_covariance_mm2 ? std::sqrt((*contact.center_covariance_mm2)(2, 2)) : 0;
  const double margin_mm = 0.1 * (rings_mm[1] - rings_mm[0]) + sigma_mm, z_mm = contact.center_mm.z();
  // A dent takes the markers beside it along the link, as it does the center.
  const auto ring_z_mm = [&](int ring) {
    const int paths = model.markers.paths;
    return shape.positions_mm[static_cast<size_t>(model.MarkerIndex((path % paths + paths) % paths, ring))]
        .z();
  };
  const double extent_mm = std::hypot(contact.major_axis_mm.z(), contact.minor_axis_mm.z());
  const double reach_mm = extent_mm > 0.5 * (rings_mm[1] - rings_mm[0]) ? extent_mm : 0;
  return !(z_mm - reach_mm >= ring_z_mm(first) + margin_mm && z_mm + reach_mm <= ring_z_mm(last) - margin_mm);
}

// Where the contact is, and all around if it is there.
bool IsBeyondMarkers(const LinkModel& model, const SkinShape& shape, const Contact& contact) {
  const double angle = std::atan2(contact.center_mm.y(), contact.center_mm.x());
  const auto path = static_cast<int>(
      std::lround((angle - model.markers.first_path_angle_rad) / model.markers.path_pitch_rad()));
  for (int beside = 0; beside < (contact.is_ring_contact ? model.markers.paths : 1); ++beside) {
    if (IsBeyondMarkersOf(model, shape, path + beside, contact)) return true;
  }
  return false;
}

}  // namespace

double DentAt(const Evidence& evidence, int marker) {
  const SkinEstimate& estimate = evidence.estimate;
  if (estimate.displacements_mm.size() != estimate.untouched_mm.size()) return 0;
  const Vec3 rest = evidence.model.RestMarker(marker);
  const Vec3 moved = (estimate.displacements_mm - estimate.untouched_mm).segment<3>(3 * marker);
  return -rest.head<2>().dot(moved.head<2>()) / rest.head<2>().norm();
}

void AddObstructionReason(const Evidence& evidence, LinkState& state) {
  const auto& obstruction = evidence.obstruction;
  if (!obstruction || evidence.diagnosis) return;  // that explains what markers are displaced
  state.reasons.push_back(
      {ReasonId::kLabels,
       ReasonText("the %s camera alone shows %d markers displaced, at path %d, ring %d by %.1f px: a hair, a "
                  "drop or dirt covers that part of its view, and what presses there may be wrong; clean its "
                  "lens and the wall there",
                  Name(obstruction->camera), obstruction->markers,
                  evidence.model.PathOf(obstruction->marker) + 1,
                  evidence.model.RingOf(obstruction->marker) + 1, obstruction->most_px),
       static_cast<double>(obstruction->markers)});
}

void AddSightReasons(const Evidence& evidence, LinkState& state) {
  if (std::any_of(state.contacts.begin(), state.contacts.end(), [&](const Contact& contact) {
        return IsBeyondMarkers(evidence.model, state.shape, contact);
      }))
    state.reasons.push_back(
        {ReasonId::kBeyondMarkers,
         "a contact lies, or may lie, on the last ring of markers in sight before a "
         "clamped end or beyond it: "
         "what presses there hardly shows, and may be stronger; press where there are markers"});
  const int left_out = MostLeftOut(evidence.model, state.shape);
  const auto left_out_in_all = static_cast<double>(state.shape.rejected.size());
  const double most_left_out = kLeftOutShare * kCameraCount * evidence.model.markers.count();
  if (!evidence.obstruction && (left_out >= kLeftOutTogether || left_out_in_all > most_left_out))
    state.reasons.push_back(
        {ReasonId::kLabels,
         "neighboring or many markers were left out because they contradict the others; clean the "
         "cameras' view, or calibrate again",
         left_out_in_all > most_left_out ? left_out_in_all : left_out,
         left_out_in_all > most_left_out ? most_left_out : kLeftOutTogether - 1});
  const double decay_mm = DecayLengthMm(evidence.model), widest_mm = kWidestGap * decay_mm;
  if (const Gap gap = WidestGap(evidence, state.shape, widest_mm); gap.length_mm() > widest_mm)
    state.reasons.push_back(
        {ReasonId::kSparseMarkers,
         ReasonText(
             "at path %d no marker is in sight from z = %.0f mm to %.0f mm, but a dent on this skin decays "
             "within %.1f mm, so that loads may hide there; clean the cameras' view, or use a model with "
             "more "
             "rings",
             gap.path + 1, gap.begin_mm, gap.end_mm, decay_mm),
         gap.length_mm(), widest_mm});
}

}  // namespace taclink

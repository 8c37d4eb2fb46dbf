#include "sensing/pipeline/judge.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"
#include "sensing/pipeline/known_loads_reasons.h"
#include "sensing/pipeline/reason_text.h"

namespace taclink {
namespace {

// Below this share of seen markers a link is called degraded.
constexpr double kDegradedShare = 0.7;
// Forces were compared with the truth down to dents of 15 mm on a link of sqrt(R t) = 11.6 mm.
constexpr double kDeepestDentMm = 16;
// Markers in sight so far apart, in sqrt(R t), over which a dent decays: forces between them were wrong.
constexpr double kWidestGap = 3.5;
// A tangent's forces are wrong by a fifth a millimeter (force-accuracy.md); likewise.
constexpr double kFirstOrderMm = 0.6;
// chi^2 per number of a region of 3 x 3 markers: right answers stay below 3, wrong ones are above, those of a
// half covered camera from 3.2 on (bench whole: none of 7 105 sound frames lies between 3 and 5).
constexpr double kMostRegionResidual = 3;
// And RMS over all markers, in standard deviations: right answers stay below 1, a squeeze that the mesh is
// too coarse for is at 1.4.
constexpr double kMostResidual = 1.2;
// Of the markers that both cameras see, those of which they disagree; wrong labels are fewer.
constexpr int kLeastApart = 4;
constexpr double kMostApartShare = 0.04;
constexpr int kLeftOutTogether = 3;     // of a marker and its neighbors
constexpr double kLeftOutShare = 0.04;  // of all labels
// What is taken up as the cameras' motion: 0.2 mm of one camera's, or 0.4 px of its lens', move markers by
// 0.4. Of cameras that have not moved it is 0.15 at most.
constexpr double kMostCameraShiftMm = 0.5;
// Contacts all around that follow each other within five elements bend the skin in waves that elements show
// badly and noise hides: on solids, the sum of six came out up to a quarter too large.
constexpr double kWaveDeg = 75, kBeltMm = 24;
// Of the limit of detection all around: below, sums on the inflated barrel were up to a quarter too small or
// too large, and on slack skins, which press far above it, within a tenth.
constexpr double kHugLimits = 4;

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

// Along the link, the clamped ends included, where no marker is in sight for half of `wide_mm` to either
// side.
Gap WidestGap(const LinkModel& model, const SkinShape& shape, double wide_mm) {
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
      if (at_mm - begin_mm > widest.length_mm()) widest = {path, begin_mm, at_mm};
      begin_mm = at_mm;
    }
  }
  return widest;
}

// Toward the axis from the inflated skin, of the marker that went furthest.
double DeepestDent(const Evidence& evidence) {
  double deepest_mm = 0;
  const SkinEstimate& estimate = evidence.estimate;
  if (estimate.displacements_mm.size() != estimate.untouched_mm.size()) return 0;
  for (int m = 0; m < evidence.model.markers.count(); ++m) {
    const Vec3 rest = evidence.model.RestMarker(m);
    const Vec3 moved = (estimate.displacements_mm - estimate.untouched_mm).segment<3>(3 * m);
    deepest_mm = std::max(deepest_mm, -rest.head<2>().dot(moved.head<2>()) / rest.head<2>().norm());
  }
  return deepest_mm;
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
// beyond, or no further inside than its center may be off.
bool IsBeyondMarkersOf(const LinkModel& model, const SkinShape& shape, int path, const Contact& contact) {
  int first = 0, last = model.markers.rings() - 1;
  while (first <= last && !IsSeenNear(model, shape, path, first, 1)) ++first;
  while (first < last && !IsSeenNear(model, shape, path, last, 1)) --last;
  if (first >= last) return true;
  const auto& rings_mm = model.markers.rings_z_mm;
  const double sigma_mm =
      contact.center_covariance_mm2 ? std::sqrt((*contact.center_covariance_mm2)(2, 2)) : 0;
  const double margin_mm = 0.1 * (rings_mm[1] - rings_mm[0]) + sigma_mm, z_mm = contact.center_mm.z();
  return !(z_mm >= rings_mm[static_cast<size_t>(first)] + margin_mm &&
           z_mm <= rings_mm[static_cast<size_t>(last)] - margin_mm);
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

bool IsEncircled(const std::vector<Contact>& contacts, double belt_mm) {
  constexpr double kFullTurn = 2 * kPi;
  return std::any_of(contacts.begin(), contacts.end(), [&](const Contact& contact) {
    std::vector<double> angles;
    for (const Contact& other : contacts) {
      if (std::abs(other.center_mm.z() - contact.center_mm.z()) <= belt_mm)
        angles.push_back(std::atan2(other.center_mm.y(), other.center_mm.x()));
    }
    std::sort(angles.begin(), angles.end());
    double widest = angles.front() + kFullTurn - angles.back();
    for (size_t i = 1; i < angles.size(); ++i) widest = std::max(widest, angles[i] - angles[i - 1]);
    return widest < RadFromDeg(kWaveDeg);
  });
}

std::optional<Reason> FailureReason(EstimateFailure failure) {
  switch (failure) {
    case EstimateFailure::kNone:
      return std::nullopt;
    case EstimateFailure::kNoEquilibrium:
      return Reason{ReasonId::kNoEquilibrium,
                    "no skin of this model is stable under the measured pressure; check the pressure and the "
                    "model's material"};
    case EstimateFailure::kImpossible:
      return Reason{ReasonId::kImpossible,
                    "what was found is not physically possible; check that the calibration is this link's"};
    case EstimateFailure::kNotConverged:
      break;
  }
  return Reason{
      ReasonId::kNotConverged,
      "no loads and pressure were found that explain the markers; check the cameras' calibration, or "
      "press less"};
}

Reason ApartReason(const CameraAgreement& agreement, double most_apart) {
  return {ReasonId::kCamerasDisagree,
          ReasonText(
              "of %d of %d markers the two cameras' lines of sight do not meet: one camera has moved, lags "
              "behind, or is another link's; check both, and calibrate again",
              agreement.apart, agreement.pairs),
          agreement.apart, most_apart};
}

void AddAgreementReason(const Evidence& evidence, LinkState& state) {
  const CameraAgreement& agreement = evidence.agreement;
  const double most_apart = std::max<double>(kLeastApart - 1, kMostApartShare * agreement.pairs);
  const bool lost = !AreOfOneSkin(agreement);
  if (lost) state.reasons.push_back(ApartReason(agreement, MostApart(agreement)));
  if (evidence.motion && evidence.motion->late_s > 0) {
    state.reasons.push_back(
        {ReasonId::kLate,
         ReasonText(
             "the %s camera shows the skin's motion %.2f s later than the other: its pictures are late; "
             "plug it in again, on a port of its own, or lower the frame rate; then touch the skin quickly",
             Name(evidence.motion->camera), evidence.motion->late_s),
         evidence.motion->late_s});
  } else if (lost) {
    return;
  } else if (evidence.motion) {
    state.reasons.push_back(
        {ReasonId::kCamerasDisagree,
         ReasonText(
             "the %s camera sees the skin move where the other does not, or did so less than 2 s ago: one "
             "lags behind, has moved itself, or is another link's; check both, and calibrate again",
             Name(evidence.motion->camera))});
  } else if (evidence.sees_alone) {
    state.reasons.push_back(
        {ReasonId::kCamerasDisagree,
         ReasonText(
             "the %s camera shows the skin pressed where the other shows it untouched: the pictures are "
             "of two moments, or a camera has moved or is another link's; check both, and calibrate again",
             Name(*evidence.sees_alone))});
  } else if (agreement.apart > most_apart) {
    state.reasons.push_back(ApartReason(agreement, most_apart));
  }
}

void AddResidualReason(LinkState& state) {
  if (state.forces.region_residual > kMostRegionResidual)
    state.reasons.push_back(
        {ReasonId::kResidual,
         ReasonText(
             "a region of markers is off the estimated shape by %.1f times what is expected, and the loads "
             "there may be others; check the model, and calibrate again",
             std::sqrt(state.forces.region_residual)),
         std::sqrt(state.forces.region_residual), std::sqrt(kMostRegionResidual)});
  else if (state.forces.residual > kMostResidual)
    state.reasons.push_back(
        {ReasonId::kResidual,
         ReasonText("the markers are off the estimated shape by %.1f times what is expected, and the loads "
                    "may be others; check the model, and calibrate again",
                    state.forces.residual),
         state.forces.residual, kMostResidual});
}

void AddModelReason(const SkinEstimate& estimate, double unit, LinkState& state) {
  if (state.forces.model == ForceModel::kLiteral)
    state.reasons.push_back(
        {ReasonId::kForceModel,
         "forces are stiffness times displacements, as the thesis has them: for comparison "
         "only; choose the force model auto"});
  if (const double off_mm = estimate.first_order_mm; off_mm > kFirstOrderMm * unit)
    state.reasons.push_back(
        {ReasonId::kForceModel,
         ReasonText(
             "the %s force model was asked for, but the skin is %.1f mm from where it holds; choose auto",
             Name(state.forces.model), off_mm),
         off_mm, kFirstOrderMm * unit});
}

// All around, an inflated skin tells little of how much presses; of what is far above the limit, enough.
void AddHugReason(LinkState& state) {
  const double least_n = kHugLimits * state.forces.limit_around_n;
  for (const Contact& contact : state.contacts) {
    if (!contact.is_ring_contact || contact.normal_force_n >= least_n) continue;
    state.reasons.push_back(
        {ReasonId::kEncircled,
         ReasonText(
             "what presses alike all around is not far above its limit of detection, %.2f N: its sum may be "
             "a quarter off, either way; let air out, or ask only whether something presses",
             state.forces.limit_around_n)});
    return;
  }
}

void AddShapeReasons(const Evidence& evidence, LinkState& state) {
  const double unit = LengthUnit(evidence.model);
  AddResidualReason(state);
  if (IsEncircled(state.contacts, kBeltMm * unit))
    state.reasons.push_back(
        {ReasonId::kEncircled,
         "contacts follow each other closely all around the skin: the sum of their "
         "forces may be a quarter off, and each much further; take them for an upper bound"});
  else
    AddHugReason(state);
  const bool is_diagnosed = evidence.diagnosis && evidence.diagnosis->id == ReasonId::kCamerasMoved;
  if (const double shift_mm = evidence.estimate.loads.camera_shift_mm;
      shift_mm > kMostCameraShiftMm * unit && !is_diagnosed)
    state.reasons.push_back(
        {ReasonId::kCamerasMoved,
         ReasonText(
             "the cameras have moved or turned since they were calibrated, so far that markers would be off "
             "by "
             "up to %.2f mm; it is taken off, but see what moved them, and calibrate again",
             shift_mm),
         shift_mm, kMostCameraShiftMm * unit});
  if (const double moved_mm = evidence.estimate.unsettled_mm; moved_mm > 0)
    state.reasons.push_back(
        {ReasonId::kUnsettled,
         ReasonText(
             "the skin may buckle where no camera sees it: its shape there moved by "
             "%.1f mm in the last step; forces and seen markers had settled; inflate the skin, or press less",
             moved_mm),
         moved_mm});
  AddModelReason(evidence.estimate, unit, state);
  if (const double dent_mm = DeepestDent(evidence); dent_mm > kDeepestDentMm * unit)
    state.reasons.push_back(
        {ReasonId::kTooDeep,
         ReasonText(
             "pressed in by %.0f mm: beyond %.0f mm forces were not compared with the truth; press less, or "
             "inflate the skin",
             dent_mm, kDeepestDentMm * unit),
         dent_mm, kDeepestDentMm * unit});
}

// What the markers that are in sight cannot tell.
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
  if (left_out >= kLeftOutTogether || left_out_in_all > most_left_out)
    state.reasons.push_back(
        {ReasonId::kLabels,
         "neighboring or many markers were left out because they contradict the others; clean the "
         "cameras' view, or calibrate again",
         left_out_in_all > most_left_out ? left_out_in_all : left_out,
         left_out_in_all > most_left_out ? most_left_out : kLeftOutTogether - 1});
  const double decay_mm = DecayLengthMm(evidence.model), widest_mm = kWidestGap * decay_mm;
  if (const Gap gap = WidestGap(evidence.model, state.shape, widest_mm); gap.length_mm() > widest_mm)
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

// What a load that was there when the baseline was taken, and has gone, looks like: the skin bulges.
bool MayComeOfBaseline(ReasonId id) {
  switch (id) {
    case ReasonId::kCamerasDisagree:
    case ReasonId::kNotConverged:
    case ReasonId::kImpossible:
    case ReasonId::kPressureMismatch:
    case ReasonId::kResidual:
    case ReasonId::kLabels:
    case ReasonId::kCamerasMoved:
      return true;
    default:
      return false;
  }
}

void AddBaselineReason(const Evidence& evidence, LinkState& state) {
  const auto may_explain = [](const Reason& reason) { return MayComeOfBaseline(reason.id); };
  if (!evidence.is_baseline_forced || std::ranges::none_of(state.reasons, may_explain)) return;
  state.reasons.push_back(
      {ReasonId::kForcedBaseline,
       "the baseline was taken by force: what touched or moved then is part of it, and may "
       "explain this; take the rest shape again with nothing at the skin (calibrate)"});
}

bool IsGrave(ReasonId id) {
  return id == ReasonId::kNotConverged || id == ReasonId::kImpossible || id == ReasonId::kNoEquilibrium;
}

Reason FewMarkersReason(int seen, int all, double limit) {
  return {ReasonId::kFewMarkers,
          ReasonText("%d of %d markers seen; check lenses, lamps, that nothing hides the skin", seen, all),
          seen, limit};
}

}  // namespace

void Judge(const Evidence& evidence, LinkState& state) {
  const int seen = state.shape.seen(), all = evidence.model.markers.count();
  state.reasons.clear();
  // A cause comes before what it does.
  if (evidence.diagnosis) state.reasons.push_back(*evidence.diagnosis);
  const bool few_are_seen = seen < kLostShare * all;
  const bool lost = few_are_seen || !AreOfOneSkin(evidence.agreement);
  if (evidence.camera_trouble) state.reasons.push_back(*evidence.camera_trouble);
  if (few_are_seen) state.reasons.push_back(FewMarkersReason(seen, all, kLostShare * all));
  if (evidence.camera_warning && !evidence.camera_trouble) state.reasons.push_back(*evidence.camera_warning);
  AddAgreementReason(evidence, state);
  if (!few_are_seen && seen < kDegradedShare * all)
    state.reasons.push_back(FewMarkersReason(seen, all, kDegradedShare * all));
  if (auto failure = FailureReason(evidence.estimate.failure); failure && !lost)
    state.reasons.push_back(*std::move(failure));
  if (!lost) AddKnownLoadsReasons(evidence, state);
  if (!lost && evidence.drift) state.reasons.push_back(*evidence.drift);
  if (!lost && state.forces.converged) {
    AddShapeReasons(evidence, state);
    AddSightReasons(evidence, state);
  }
  AddBaselineReason(evidence, state);
  if (!lost)
    std::stable_partition(state.reasons.begin(), state.reasons.end(),
                          [](const Reason& reason) { return IsGrave(reason.id); });
  const bool grave = std::any_of(state.reasons.begin(), state.reasons.end(),
                                 [](const Reason& reason) { return IsGrave(reason.id); });
  state.status = lost ? LinkStatus::kLost : state.reasons.empty() ? LinkStatus::kOk : LinkStatus::kDegraded;
  state.status_reason = state.reasons.empty() ? "" : state.reasons.front().text;
  if (lost) {
    state.ClearMeasurement();
  } else if (grave) {
    // Forces that can't be trusted are not shown; the measured shape is.
    state.contacts.clear();
    state.total_force_n.setZero();
    std::fill(state.forces.forces_n.begin(), state.forces.forces_n.end(), Vec3::Zero());
    std::fill(state.forces.sigmas_n.begin(), state.forces.sigmas_n.end(), 0);
    state.forces.loaded.clear();
    state.forces.limits_n.clear();
    state.forces.limit_around_n = 0;
  }
}

}  // namespace taclink

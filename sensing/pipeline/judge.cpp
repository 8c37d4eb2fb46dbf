#include "sensing/pipeline/judge.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"
#include "sensing/pipeline/encirclement.h"
#include "sensing/pipeline/known_loads_reasons.h"
#include "sensing/pipeline/reason_text.h"
#include "sensing/pipeline/sight_reasons.h"

namespace taclink {
namespace {

// Of the contrast at rest: forces are still right, but where haze or darkness grow it is not long until
// contacts are missed.
constexpr double kLeastContrast = 0.4;
// Below this share of seen markers a link is called degraded.
constexpr double kDegradedShare = 0.7;
// Forces of bodies of 5 to 40 mm on both shipped links, from slack to 1 kPa, are right within 8 % down to 20
// mm, of a link of sqrt(R t) = 11.6 mm, and a fifth too small from 21 mm on (bench whole, scenes like
// "deep").
constexpr double kDeepestDentMm = 20;
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
// What is taken up as the cameras' motion: 0.2 mm of one camera's, or 0.4 px of its lens', move markers by
// 0.4. Of cameras that have not moved it is 0.15 at most.
constexpr double kMostCameraShiftMm = 0.5;
// Of the limit of detection all around: below, sums on the inflated barrel and of six discs on inflated
// solids were up to a quarter too small or too large; above, mostly within a tenth.
constexpr double kEncirclementLimits = 4;

std::optional<Reason> FailureReason(EstimateFailure failure) {
  switch (failure) {
    case EstimateFailure::kNone:
      return std::nullopt;
    case EstimateFailure::kNoEquilibrium:
      return Reason{ReasonId::kNoEquilibrium,
                    "no skin of this model is stable and clear of its tube under the measured pressure and "
                    "acceleration; check both, and the model's material and density"};
    case EstimateFailure::kImpossible:
      return Reason{ReasonId::kImpossible,
                    "what was found is not physically possible; check that the calibration is this link's"};
    case EstimateFailure::kGrossErrors:
      return Reason{
          ReasonId::kNotConverged,
          "no forces on the skin move its markers so: the images are damaged or of two moments, one "
          "camera has moved, or markers are labeled wrongly; check images and cameras"};
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

void AddContrastReason(LinkState& state) {
  for (const CameraId id : kBothCameras) {
    const std::optional<double> contrast = state.cameras[Index(id)].contrast;
    if (!contrast || *contrast >= kLeastContrast) continue;
    state.reasons.push_back(
        {ReasonId::kImageContrast,
         ReasonText(
             "in the %s camera's images markers have %.0f %% of the contrast that they had when the rest "
             "shape was taken, and weak contacts may be missed; clean the lens, and check lamp, focus "
             "and exposure",
             Name(id), 100 * *contrast),
         *contrast, kLeastContrast});
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

// All around, an inflated skin shows little of how much presses; of what is far above the limit, enough.
void AddEncirclementReason(const LinkModel& model, LinkState& state) {
  const double least_n = kEncirclementLimits * state.forces.limit_around_n;
  for (const Encirclement& around : FindEncirclements(model, state.contacts)) {
    if (around.normal_force_n >= least_n) continue;
    state.reasons.push_back(
        {ReasonId::kEncircled,
         ReasonText(
             "what presses all around the skin, %.2f N, is not far above its limit of detection there, "
             "%.2f N: the sum may be a quarter off, and each of several contacts much further; let air "
             "out, or ask only whether something presses",
             around.normal_force_n, state.forces.limit_around_n)});
    return;
  }
}

void AddShapeReasons(const Evidence& evidence, LinkState& state) {
  const double unit = LengthUnit(evidence.model);
  AddResidualReason(state);
  AddEncirclementReason(evidence.model, state);
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
  double dent_mm = 0;
  for (int m = 0; m < evidence.model.markers.count(); ++m) dent_mm = std::max(dent_mm, DentAt(evidence, m));
  if (dent_mm > kDeepestDentMm * unit)
    state.reasons.push_back({ReasonId::kTooDeep,
                             ReasonText("pressed in by %.0f mm: beyond %.0f mm forces come out too small; "
                                        "press less, or inflate the skin",
                                        dent_mm, kDeepestDentMm * unit),
                             dent_mm, kDeepestDentMm * unit});
}

void AddBaselineReason(const Evidence& evidence, LinkState& state) {
  const auto may_explain = [](const Reason& reason) { return TraitsOf(reason.id).may_come_of_baseline; };
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
  if (!lost) AddContrastReason(state);
  if (!lost && state.forces.converged) {
    AddObstructionReason(evidence, state);
    AddShapeReasons(evidence, state);
    AddSightReasons(evidence, state);
  }
  AddBaselineReason(evidence, state);
  if (!lost)
    std::stable_partition(state.reasons.begin() + (evidence.diagnosis ? 1 : 0), state.reasons.end(),
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

#include "sensing/pipeline/camera_diagnosis.h"

#include <algorithm>
#include <cmath>

#include "sensing/pipeline/image_displacement.h"
#include "sensing/pipeline/reason_text.h"

namespace taclink {
namespace {

constexpr int64_t kPauseNs = 500'000'000;
constexpr int kLeastFrames = 3;  // a single bad image has no cause that lasts
constexpr int64_t kGrowthHoldsNs = 2'000'000'000;
constexpr int kMostSpots = 3;  // for each marker; more are clutter, and take long
// Growth of an image that is a reason: 0.1 mm of a skin of 40 mm. Of links without faults it was 0.2 % at
// most in all scenes of the whole benchmark up to 0.5 kPa, and 3.5 % of what pressure had widened the skin by
// since the baseline, by which the model's inflation is wrong.
constexpr double kMostGrowth = 0.003, kGrowthSigmas = 3, kInflationError = 0.05;

double MeanRadiusMm(const LinkModel& model) {
  double sum_mm = 0;
  for (int m = 0; m < model.markers.count(); ++m) sum_mm += model.RestMarker(m).head<2>().norm();
  return sum_mm / model.markers.count();
}

// By how much pressure and weight have widened the skin since the baseline, a share of its radius.
double Widening(const LinkModel& model, const SkinEstimate& estimate) {
  if (estimate.untouched_mm.size() != estimate.baseline_mm.size()) return 0;
  double radii_mm = 0, wider_mm = 0;
  for (int m = 0; m < model.markers.count(); ++m) {
    const Vec2 rest_mm = model.RestMarker(m).head<2>();
    const double radius_mm = rest_mm.norm();
    radii_mm += radius_mm;
    wider_mm += rest_mm.dot((estimate.untouched_mm - estimate.baseline_mm).segment<2>(3 * m)) / radius_mm;
  }
  return wider_mm / radii_mm;
}

}  // namespace

void CameraDiagnosis::Begin(SkinMechanics& mechanics, const MeasuredLoads& loads, const StereoRig& rig,
                            const LabelledMarkers& rest, const std::optional<Reason>& moved) {
  rig_ = rig;
  moved_ = moved;
  drift_.emplace(mechanics, loads, rig, rest);
  growth_.reset();
  reason_.reset();
  grown_frames_ = suspect_frames_ = 0;
  next_ns_ = 0;
}

void CameraDiagnosis::ObserveGrowth(const Frame& frame, int64_t now_ns) {
  const auto growth = drift_ ? drift_->Measure(frame.residuals) : std::nullopt;
  if (!growth) {
    if (now_ns > grown_until_ns_) growth_.reset();
    return;
  }
  const CameraId id =
      std::abs((*growth)[0].share) > std::abs((*growth)[1].share) ? CameraId::kTop : CameraId::kBottom;
  const auto& [share, sigma] = (*growth)[Index(id)];
  const double most = std::max(kMostGrowth + kInflationError * std::abs(Widening(model_, frame.estimate)),
                               kGrowthSigmas * sigma);
  grown_frames_ = std::abs(share) > most ? grown_frames_ + 1 : 0;
  if (grown_frames_ == 0) growth_.reset();
  if (grown_frames_ < kLeastFrames) return;
  grown_until_ns_ = now_ns + kGrowthHoldsNs;
  const double radius_mm = MeanRadiusMm(model_);
  growth_ =
      Reason{ReasonId::kCamerasMoved,
             ReasonText("the %s camera's image is %.1f %% %s than when the baseline was taken: its lens "
                        "warms, its focus creeps, or it has moved along the link; forces may be wrong; let "
                        "it come to rest and calibrate again",
                        Name(id), 100 * std::abs(share), share > 0 ? "larger" : "smaller"),
             std::abs(share) * radius_mm, most * radius_mm};
}

void CameraDiagnosis::Observe(const LinkState& state, const Frame& frame) {
  // The reason that this class gave for the frame before is among the state's, and confirms nothing.
  const std::optional<Reason>& own = reason();
  const auto may_come = [&](const Reason& one) {
    return TraitsOf(one.id).may_come_of_cameras && !(own && one.text == own->text);
  };
  suspect_frames_ = std::ranges::any_of(state.reasons, may_come) ? suspect_frames_ + 1 : 0;
  const int64_t now_ns = state.times.exposure_monotonic_ns;
  ObserveGrowth(frame, now_ns);
  if (frame.obstruction) {  // which explains the reasons
    reason_.reset();
    suspect_frames_ = 0;
  }
  // A reason stands until a later look does not find it.
  if (suspect_frames_ < kLeastFrames && !reason_) return;
  if (now_ns < next_ns_ && now_ns >= next_ns_ - kPauseNs) return;
  next_ns_ = now_ns + kPauseNs;
  for (size_t i = 0; i < kCameraCount; ++i) {
    spots_[i].clear();
    if (!frame.images[i].empty()) detector_.Detect(frame.images[i], spots_[i]);
    if (static_cast<int>(spots_[i].size()) > kMostSpots * model_.markers.count()) spots_[i].clear();
  }
  reason_ = DiagnoseImages(model_, rig_, frame.skin_mm, spots_);
}

}  // namespace taclink

#include "sensing/pipeline/rest_comparison.h"

#include "sensing/core/similar_skin.h"

namespace taclink {

RestComparison::RestComparison(const LinkModel& model, const StereoRig& rig, double noise_px)
    : length_unit_(LengthUnit(model)), reader_(model, rig, noise_px) {
  reader_.Forget(baseline_);
  reader_.Forget(now_);
}

std::optional<CameraId> RestComparison::SeesAlone(const LabelledMarkers& now, const Expected& expected_mm) {
  reader_.Read(now, now_);
  for (size_t m = 0; m < reader_.compared().size(); ++m) {
    for (const CameraId id : kBothCameras) {
      const Vec3& expected = expected_mm[Index(id)][static_cast<size_t>(reader_.compared()[m])];
      now_.mm[Index(id)](static_cast<Eigen::Index>(m)) -=
          static_cast<float>(reader_.ByPlace(m, id).dot(expected));
    }
  }
  const auto moved = CompareRadii(baseline_, now_, kLeastMovedMm * length_unit_, kMostSeen);
  return moved ? moved->alone : std::nullopt;
}

}  // namespace taclink

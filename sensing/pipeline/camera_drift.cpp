#include "sensing/pipeline/camera_drift.h"

#include <Eigen/LU>
#include <cmath>

#include "sensing/camera/camera_fit.h"
#include "sensing/camera/projection.h"
#include "sensing/camera/rest_shape.h"
#include "sensing/estimation/touch_responses.h"

namespace taclink {
namespace {

// Standard deviation of a marker's motion in an image against the first-order model, each axis.
constexpr double kSigmaPx = 0.2;
// Beyond this RMS residual, in standard deviations, the model does not hold.
constexpr double kMostRms = 1.5;
constexpr double kLeastSeen = 0.8;  // of each camera's rows; the others count as not moved
constexpr int kMostDriftForces = 3;
// Standard deviations of a camera's change: wide, since it is what is measured.
constexpr double kTurnRad = 0.02, kMoveMm = 1, kScale = 0.03;
constexpr double kSpecificForceMps2 = 0.5;  // likewise, of what is measured of it at least

}  // namespace

CameraDrift::CameraDrift(SkinMechanics& mechanics, const MeasuredLoads& loads, const StereoRig& rig,
                         const LabelledMarkers& rest) {
  SetRows(mechanics, loads.Loads(), rig, rest);
  Eliminate(mechanics, loads);
}

void CameraDrift::SetRows(SkinMechanics& mechanics, const KnownLoads& loads, const StereoRig& rig,
                          const LabelledMarkers& rest) {
  const auto responses = TouchResponses(mechanics, loads);
  const UntouchedSkin* const skin = mechanics.Untouched(loads);
  if (!responses || skin == nullptr) return;  // no rows: nothing is measured
  const RestShape shape(mechanics.model(), skin->markers_mm);
  const int markers = mechanics.marker_count();
  const auto most = static_cast<Eigen::Index>(2 * kCameraCount) * markers;
  modes_.setZero(most, kModes);
  touches_.resize(most, responses->cols());
  for (const CameraId id : kBothCameras) {
    const Projector projector(rig[id]);
    const auto first = kModesOfCamera * static_cast<Eigen::Index>(Index(id));
    Modes pulls = Modes::Zero();
    double squares = 0;
    for (int m = 0; m < markers; ++m) {
      const MarkerObservation& seen = rest.cameras[Index(id)][static_cast<size_t>(m)];
      const auto at =
          projector.ProjectWithCameraJacobian(SeenPoint(shape, m, projector.center_in_link(), true));
      if (!seen.seen || !at) continue;
      const Vec2 radius_px = seen.center_px - rig[id].lens.principal_point_px;
      const auto row = 2 * static_cast<Eigen::Index>(rows_.size());
      modes_.block<2, 3>(row, first) = at->by_camera.leftCols<3>() * kTurnRad;
      modes_.block<2, 3>(row, first + 3) = at->by_camera.middleCols<3>(3) * kMoveMm;
      modes_.block<2, 1>(row, first + 6) = radius_px * kScale;
      pulls.segment<kModesOfCamera>(first) +=
          modes_.block<2, kModesOfCamera>(row, first).transpose() * radius_px;
      squares += radius_px.squaredNorm();
      modes_.block<2, KnownLoads::kCount>(row, kModes - KnownLoads::kCount) =
          at->by_point * skin->markers_by_loads.middleRows<3>(3 * m);
      touches_.middleRows<2>(row) = at->by_point * responses->middleRows<3>(3 * m).cast<double>();
      rows_.push_back({m, id});
      ++rows_of_camera_[Index(id)];
    }
    growth_by_modes_[Index(id)] = pulls / std::max(1.0, squares);
  }
  const auto rows = 2 * static_cast<Eigen::Index>(rows_.size());
  modes_ = (modes_.topRows(rows) / kSigmaPx).eval();
  touches_ = (touches_.topRows(rows) / kSigmaPx).eval();
}

void CameraDrift::Eliminate(const SkinMechanics& mechanics, const MeasuredLoads& loads) {
  Mat4 errors = Mat4::Zero();
  errors(0, 0) = std::pow(std::max(loads.pressure_sigma_mpa, mechanics.pressure_step()), 2);
  errors.bottomRightCorner<3, 3>() =
      loads.specific_force_covariance + kSpecificForceMps2 * kSpecificForceMps2 * Mat3::Identity();
  Eigen::Matrix<double, kModes, kModes> information = modes_.transpose() * modes_;
  information.diagonal().head<kModes - KnownLoads::kCount>().array() += 1;
  information.bottomRightCorner<KnownLoads::kCount, KnownLoads::kCount>() += errors.inverse();
  information_.compute(information);
  modes_by_touches_ = modes_.transpose() * touches_;
  reduced_.normal =
      touches_.transpose() * touches_ - modes_by_touches_.transpose() * information_.solve(modes_by_touches_);
  reduced_.pulls.setZero(touches_.cols());
  y_.setZero(modes_.rows());
}

std::optional<std::array<CameraDrift::Growth, kCameraCount>> CameraDrift::Measure(
    const ImageResiduals& residuals) {
  std::array<int, kCameraCount> seen = {};
  y_.setZero();
  for (size_t i = 0; i < rows_.size(); ++i) {
    const auto& camera = residuals[Index(rows_[i].camera)];
    const auto marker = static_cast<size_t>(rows_[i].marker);
    if (marker >= camera.size() || !camera[marker]) continue;
    y_.segment<2>(2 * static_cast<Eigen::Index>(i)) = camera[marker]->px / kSigmaPx;
    ++seen[Index(rows_[i].camera)];
  }
  for (size_t c = 0; c < kCameraCount; ++c) {
    if (seen[c] == 0 || seen[c] < kLeastSeen * rows_of_camera_[c]) return std::nullopt;
  }
  Modes pulls;
  pulls.noalias() = modes_.transpose() * y_;
  const Modes solved = information_.solve(pulls);
  reduced_.squares = y_.squaredNorm() - pulls.dot(solved);
  reduced_.pulls.noalias() = touches_.transpose() * y_;
  reduced_.pulls.noalias() -= modes_by_touches_.transpose() * solved;
  const SelectedTouches touches = SelectTouches(reduced_, kMostDriftForces, TouchSign::kAny);
  const double most_squares = kMostRms * kMostRms * 2 * (seen[0] + seen[1]);
  if (!(reduced_.squares - touches.gain <= most_squares)) return std::nullopt;
  for (int i = 0; i < touches.count; ++i)
    pulls -=
        touches.force_n[static_cast<size_t>(i)] * modes_by_touches_.col(touches.at[static_cast<size_t>(i)]);
  const Modes found = information_.solve(pulls);
  std::array<Growth, kCameraCount> growth;
  for (size_t c = 0; c < kCameraCount; ++c) {
    const Modes by_growth = information_.solve(growth_by_modes_[c]);
    growth[c] = {.share = growth_by_modes_[c].dot(found),
                 .sigma = std::sqrt(growth_by_modes_[c].dot(by_growth))};
  }
  return growth;
}

}  // namespace taclink

#include "sensing/estimation/calibration_doubt.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

#include "sensing/camera/projection.h"

namespace taclink {
namespace {

constexpr int kAllParameters = kCameraParameters * kCameraCount;
constexpr int kMostDirections = 4;
constexpr double kStepMm = 1;
// Along a direction that no camera tells the skin's mechanics decide, not the cameras.
constexpr double kLeastInformation = 0.01;  // of the largest

/// How a marker's displacement errs by the cameras' parameters: 9 x 26, the errors (x, y, z) per mm moved
/// along x, then along y, then along z.
using Sensitivity = Eigen::Matrix<double, 9, kAllParameters>;

Sensitivity SensitivityOf(const std::array<Projector, kCameraCount>& cameras, const Vec3& rest_mm) {
  Mat3 information = Mat3::Zero();
  Sensitivity pull = Sensitivity::Zero();
  for (int c = 0; c < kCameraCount; ++c) {
    const Projector& camera = cameras[static_cast<size_t>(c)];
    const auto at_rest = camera.ProjectWithCameraJacobian(rest_mm);
    if (!at_rest) continue;
    information += at_rest->by_point.transpose() * at_rest->by_point;
    for (int axis = 0; axis < 3; ++axis) {
      const auto moved = camera.ProjectWithCameraJacobian(rest_mm + kStepMm * Vec3::Unit(axis));
      if (!moved) continue;
      pull.block<3, kCameraParameters>(3 * axis, c * kCameraParameters) =
          at_rest->by_point.transpose() * (moved->by_camera - at_rest->by_camera) / kStepMm;
    }
  }
  const double least = kLeastInformation * information.trace();
  const auto solved = (information + least * Mat3::Identity()).ldlt();
  Sensitivity out;
  for (int axis = 0; axis < 3; ++axis)
    out.middleRows<3>(3 * axis) = solved.solve(pull.middleRows<3>(3 * axis));
  return out;
}

}  // namespace

CalibrationDoubt::CalibrationDoubt(const LinkModel& model, const StereoRig& rig,
                                   const Eigen::MatrixXd& covariance) {
  if (covariance.rows() != kAllParameters) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parameters(covariance);
  const Eigen::MatrixXd root =
      parameters.eigenvectors() * parameters.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  const std::array<Projector, kCameraCount> cameras{Projector(rig[CameraId::kTop]),
                                                    Projector(rig[CameraId::kBottom])};
  const std::vector<Vec3> rest = model.RestMarkers();
  Eigen::MatrixXd effects(9 * static_cast<Eigen::Index>(rest.size()), kAllParameters);
  for (size_t m = 0; m < rest.size(); ++m)
    effects.middleRows<9>(9 * static_cast<Eigen::Index>(m)) = SensitivityOf(cameras, rest[m]) * root;
  // A few directions of the parameters have nearly all of the effect.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> strongest(effects.transpose() * effects);
  directions_ = std::min<int>(kMostDirections, kAllParameters);
  const Eigen::MatrixXd kept = effects * strongest.eigenvectors().rightCols(directions_);
  per_mm_.resize(rest.size() * static_cast<size_t>(directions_));
  for (size_t m = 0; m < rest.size(); ++m) {
    for (int k = 0; k < directions_; ++k) {
      Mat3& each = per_mm_[m * static_cast<size_t>(directions_) + static_cast<size_t>(k)];
      for (int axis = 0; axis < 3; ++axis)
        each.col(axis) = kept.block<3, 1>(9 * static_cast<Eigen::Index>(m) + 3 * axis, k);
    }
  }
}

Mat3 CalibrationDoubt::Of(size_t marker, const Vec3& u_mm) const {
  Mat3 out = Mat3::Zero();
  for (int k = 0; k < directions_; ++k) {
    const Vec3 error = per_mm_[marker * static_cast<size_t>(directions_) + static_cast<size_t>(k)] * u_mm;
    out.noalias() += error * error.transpose();
  }
  return out;
}

}  // namespace taclink

#include "sensing/camera/camera_shift.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/core/median.h"
#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

using Motion = Eigen::Matrix<double, 6, 1>;  // first part of a CameraStep: rotation vector, position
using Information = Eigen::Matrix<double, 6, 6>;

constexpr size_t kLeastPoints = 20;
constexpr int kMostSteps = 10;
constexpr double kHuberSigmas = 1.345;
constexpr double kLeastNoisePx = 0.02;
constexpr double kConvergedMm = 1e-4, kConvergedRad = 1e-6;
constexpr double kLargeMm = 0.25, kLargeRad = 0.09 * std::numbers::pi / 180, kLargeSigmas = 4;

struct NormalEquations {
  Information information = Information::Zero();
  Motion gradient = Motion::Zero();
};

// Robust noise of one image axis, from the median of absolute residuals.
double NoisePx(const std::vector<Vec2>& residuals) {
  std::vector<double> sizes;
  for (const Vec2& one : residuals) {
    sizes.push_back(std::abs(one.x()));
    sizes.push_back(std::abs(one.y()));
  }
  return std::max(kLeastNoisePx, 1.4826 * Median(sizes));
}

}  // namespace

std::optional<CameraShift> FindCameraShift(const CameraModel& camera, std::span<const PointImage> images) {
  if (images.size() < kLeastPoints) return std::nullopt;
  CameraModel moved = camera;
  std::vector<Vec2> residuals(images.size());
  std::vector<Eigen::Matrix<double, 2, 6>> jacobians(images.size());
  for (int step = 0; step < kMostSteps; ++step) {
    const Projector projector(moved);
    for (size_t i = 0; i < images.size(); ++i) {
      const auto seen = projector.ProjectWithCameraJacobian(images[i].at_mm);
      if (!seen) return std::nullopt;
      residuals[i] = images[i].pixel - seen->pixel;
      jacobians[i] = seen->by_camera.leftCols<6>();
    }
    const double noise_px = NoisePx(residuals);
    NormalEquations sum;
    for (size_t i = 0; i < images.size(); ++i) {
      const double sigmas = residuals[i].norm() / noise_px;
      const double weight = std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12)) / (noise_px * noise_px);
      sum.information += weight * jacobians[i].transpose() * jacobians[i];
      sum.gradient += weight * jacobians[i].transpose() * residuals[i];
    }
    const Eigen::LDLT<Information> solver(sum.information);
    if (solver.info() != Eigen::Success || solver.rcond() < std::numeric_limits<double>::epsilon())
      return std::nullopt;
    const Motion motion = solver.solve(sum.gradient);
    if (motion.head<3>().norm() < kConvergedRad && motion.tail<3>().norm() < kConvergedMm) {
      const CameraStep all = StepBetween(camera, moved);
      const Information covariance = solver.solve(Information::Identity());
      return CameraShift{.moved_mm = all.segment<3>(3).norm(),
                         .moved_sigma_mm = std::sqrt(covariance.diagonal().tail<3>().maxCoeff()),
                         .turned_rad = all.head<3>().norm(),
                         .turned_sigma_rad = std::sqrt(covariance.diagonal().head<3>().maxCoeff())};
    }
    CameraStep whole = CameraStep::Zero();
    whole.head<6>() = motion;
    moved = Moved(moved, whole);
  }
  return std::nullopt;
}

double LargeShiftMm(const LinkModel& model) {
  return kLargeMm * LengthUnit(model);
}

bool IsLarge(const CameraShift& shift, const LinkModel& model) {
  const bool moved =
      shift.moved_mm > LargeShiftMm(model) && shift.moved_mm > kLargeSigmas * shift.moved_sigma_mm;
  const bool turned =
      shift.turned_rad > kLargeRad && shift.turned_rad > kLargeSigmas * shift.turned_sigma_rad;
  return moved || turned;
}

}  // namespace taclink

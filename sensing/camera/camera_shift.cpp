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

constexpr size_t kLeastPoints = 20;
constexpr int kMostSteps = 10;
constexpr double kHuberSigmas = 1.345;
constexpr double kLeastNoisePx = 0.02;
constexpr double kConvergedMm = 1e-4, kConvergedRad = 1e-6;
constexpr double kLargeMm = 0.25, kLargeRad = 0.09 * std::numbers::pi / 180, kLargeSigmas = 4;

// Robust noise of one image axis, from the median of absolute residuals.
double NoisePx(const std::vector<Vec2>& residuals) {
  std::vector<double> sizes;
  for (const Vec2& one : residuals) {
    sizes.push_back(std::abs(one.x()));
    sizes.push_back(std::abs(one.y()));
  }
  return std::max(kLeastNoisePx, 1.4826 * Median(sizes));
}

constexpr Eigen::Index kMotion = 6;  // first part of a CameraStep: rotation vector, position

/// Motions of cameras one after the other, then shares of the shape's common errors.
class ShiftFit {
 public:
  ShiftFit(std::span<const CameraModel> cameras, std::span<const std::vector<PointImage>> images)
      : calibrated_(cameras), moved_(cameras.begin(), cameras.end()), images_(images) {
    const auto errors = images.front().front().errors_mm.size();
    shares_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(errors));
  }

  // False: no convergence.
  bool Run() {
    for (int step = 0; step < kMostSteps; ++step) {
      const Eigen::Index motions = kMotion * static_cast<Eigen::Index>(moved_.size());
      const Eigen::Index size = motions + shares_.size();
      information_ = Eigen::MatrixXd::Zero(size, size);
      gradient_ = Eigen::VectorXd::Zero(size);
      information_.diagonal().tail(shares_.size()).setOnes();  // the prior
      gradient_.tail(shares_.size()) = -shares_;
      for (size_t c = 0; c < moved_.size(); ++c) {
        if (!Add(c)) return false;
      }
      solver_.compute(information_);
      if (solver_.info() != Eigen::Success || solver_.rcond() < std::numeric_limits<double>::epsilon())
        return false;
      const Eigen::VectorXd change = solver_.solve(gradient_);
      shares_ += change.tail(shares_.size());
      bool has_converged = true;
      for (size_t c = 0; c < moved_.size(); ++c) {
        const auto motion = change.segment<kMotion>(kMotion * static_cast<Eigen::Index>(c));
        has_converged = has_converged && motion.head<3>().norm() < kConvergedRad &&
                        motion.tail<3>().norm() < kConvergedMm;
        CameraStep whole = CameraStep::Zero();
        whole.head<kMotion>() = motion;
        moved_[c] = Moved(moved_[c], whole);
      }
      if (has_converged) return true;
    }
    return false;
  }

  CameraShift ShiftOf(size_t camera) const {
    const CameraStep all = StepBetween(calibrated_[camera], moved_[camera]);
    const Eigen::VectorXd variances =
        solver_.solve(Eigen::MatrixXd::Identity(information_.rows(), information_.cols())).diagonal();
    const auto of = variances.segment<kMotion>(kMotion * static_cast<Eigen::Index>(camera));
    return {.moved_mm = all.segment<3>(3).norm(),
            .moved_sigma_mm = std::sqrt(of.tail<3>().maxCoeff()),
            .turned_rad = all.head<3>().norm(),
            .turned_sigma_rad = std::sqrt(of.head<3>().maxCoeff())};
  }

 private:
  // One camera's images to the normal equations. False: it cannot see a point.
  bool Add(size_t camera) {
    const std::vector<PointImage>& images = images_[camera];
    const Projector projector(moved_[camera]);
    std::vector<Vec2> residuals(images.size());
    std::vector<Eigen::MatrixXd> jacobians(images.size());
    for (size_t i = 0; i < images.size(); ++i) {
      Vec3 at_mm = images[i].at_mm;
      for (Eigen::Index k = 0; k < shares_.size(); ++k)
        at_mm += shares_[k] * images[i].errors_mm[static_cast<size_t>(k)];
      const auto seen = projector.ProjectWithCameraJacobian(at_mm);
      if (!seen) return false;
      residuals[i] = images[i].pixel - seen->pixel;
      Eigen::MatrixXd& jacobian = jacobians[i];
      jacobian = Eigen::MatrixXd::Zero(2, information_.cols());
      jacobian.middleCols<kMotion>(kMotion * static_cast<Eigen::Index>(camera)) =
          seen->by_camera.leftCols<kMotion>();
      for (Eigen::Index k = 0; k < shares_.size(); ++k)
        jacobian.col(jacobian.cols() - shares_.size() + k) =
            seen->by_point * images[i].errors_mm[static_cast<size_t>(k)];
    }
    const double noise_px = NoisePx(residuals);
    for (size_t i = 0; i < images.size(); ++i) {
      const double sigmas = residuals[i].norm() / noise_px;
      const double weight = std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-12)) / (noise_px * noise_px);
      information_ += weight * jacobians[i].transpose() * jacobians[i];
      gradient_ += weight * jacobians[i].transpose() * residuals[i];
    }
    return true;
  }

  const std::span<const CameraModel> calibrated_;
  std::vector<CameraModel> moved_;
  const std::span<const std::vector<PointImage>> images_;
  Eigen::VectorXd shares_, gradient_;
  Eigen::MatrixXd information_;
  Eigen::LDLT<Eigen::MatrixXd> solver_;
};

}  // namespace

std::optional<std::array<CameraShift, kCameraCount>> FindCameraShifts(
    const StereoRig& rig, const std::array<std::vector<PointImage>, kCameraCount>& images) {
  for (const auto& of_camera : images) {
    if (of_camera.size() < kLeastPoints) return std::nullopt;
  }
  ShiftFit fit(rig.cameras, images);
  if (!fit.Run()) return std::nullopt;
  std::array<CameraShift, kCameraCount> shifts;
  for (size_t c = 0; c < kCameraCount; ++c) shifts[c] = fit.ShiftOf(c);
  return shifts;
}

std::optional<CameraShift> FindCameraShift(const CameraModel& camera, std::span<const PointImage> images) {
  if (images.size() < kLeastPoints) return std::nullopt;
  const std::vector<PointImage> of_camera(images.begin(), images.end());
  ShiftFit fit({&camera, 1}, {&of_camera, 1});
  if (!fit.Run()) return std::nullopt;
  return fit.ShiftOf(0);
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

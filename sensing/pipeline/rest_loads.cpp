#include "sensing/pipeline/rest_loads.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "sensing/camera/camera_fit.h"
#include "sensing/camera/projection.h"
#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

constexpr double kSurelyKnownMm = 0.5;  // that errors of the specific force move no marker beyond, in units
constexpr double kSettledFitMm = 0.03;  // likewise, of the last step
constexpr double kModelPx = 0.5;        // of a marker that nothing touches, besides the image's noise
constexpr double kHuberSigmas = 1.5;
constexpr int kMostFitSteps = 8;
constexpr double kUnknownMps2 = 1;  // standard deviation of each component: nobody has measured the attitude
constexpr double kGuessedShares[] = {1.0, 0.6};  // of gravity, across the link
constexpr int kGuessedDirections = 8;

/// Normal equations of the robust sum about a shape, in shares of the errors.
struct RestEquations {
  Mat3 information = Mat3::Identity();
  Vec3 pull = Vec3::Zero();
};

RestEquations EquationsOf(const RestShape& shape, const StereoRig& rig, const LabelledMarkers& rest,
                          const Vec3& shares) {
  RestEquations sum{.pull = -shares};
  for (const CameraId id : kBothCameras) {
    const Projector projector(rig[id]);
    for (int m = 0; m < shape.model().markers.count(); ++m) {
      const MarkerObservation& seen = rest.cameras[Index(id)][static_cast<size_t>(m)];
      if (!seen.seen) continue;
      const auto expected =
          projector.ProjectWithJacobian(SeenPoint(shape, m, projector.center_in_link(), true));
      if (!expected) continue;
      const Mat2 weight = (seen.covariance_px2 + kModelPx * kModelPx * Mat2::Identity()).inverse();
      const Vec2 off = seen.center_px - expected->pixel;
      const double sigmas = std::sqrt(off.dot(weight * off));
      const double trust = sigmas > kHuberSigmas ? kHuberSigmas / sigmas : 1;
      const Eigen::Matrix<double, 2, 3> by = expected->jacobian * shape.errors_mm().middleRows<3>(3 * m);
      sum.information += trust * by.transpose() * weight * by;
      sum.pull += trust * by.transpose() * weight * off;
    }
  }
  return sum;
}

}  // namespace

Mat3 SpecificForceErrors(const MeasuredLoads& loads) {
  const Eigen::SelfAdjointEigenSolver<Mat3> modes(loads.specific_force_covariance);
  return modes.eigenvectors() * modes.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
         modes.eigenvectors().transpose();
}

bool IsRestUncertain(const RestShape& shape) {
  return shape.errors_mm().size() > 0 &&
         shape.errors_mm().cwiseAbs().maxCoeff() > kSurelyKnownMm * LengthUnit(shape.model());
}

bool IsAttitudeUnknown(const MeasuredLoads& loads) {
  return loads.specific_force_covariance.diagonal().minCoeff() > kUnknownMps2 * kUnknownMps2;
}

std::vector<MeasuredLoads> RestGuesses(const MeasuredLoads& measured) {
  std::vector<MeasuredLoads> guesses = {measured};
  if (!IsAttitudeUnknown(measured)) return guesses;
  for (const double share : kGuessedShares) {
    for (int i = 0; i < kGuessedDirections; ++i) {
      const double angle = 2 * kPi * i / kGuessedDirections;
      guesses.push_back(measured);
      guesses.back().specific_force_mps2 +=
          share * kStandardGravity * Vec3(std::cos(angle), std::sin(angle), 0);
    }
  }
  return guesses;
}

void MeasureGravity(MeasuredLoads& loads, double sigma_mps2) {
  Vec3& found = loads.specific_force_mps2;
  if (found.norm() < kUnknownMps2) return;  // without a direction the update has no meaning
  Mat3& covariance = loads.specific_force_covariance;
  const Vec3 along = found.normalized();
  const Vec3 gain = covariance * along / (along.dot(covariance * along) + sigma_mps2 * sigma_mps2);
  found += gain * (kStandardGravity - found.norm());
  covariance -= gain * (along.transpose() * covariance);
}

std::optional<MeasuredLoads> FitRestLoads(const MeasuredLoads& measured, const RestShapeAt& shape_at,
                                          const StereoRig& rig, const LabelledMarkers& rest) {
  const Mat3 errors = SpecificForceErrors(measured);
  MeasuredLoads fitted = measured;
  Vec3 shares = Vec3::Zero();
  for (int step = 0; step < kMostFitSteps; ++step) {
    MeasuredLoads tried = measured;
    tried.specific_force_mps2 += errors * shares;
    const auto shape = shape_at(tried);
    if (!shape) return std::nullopt;
    const RestEquations sum = EquationsOf(*shape, rig, rest, shares);
    const Vec3 more = sum.information.llt().solve(sum.pull);
    if (!more.allFinite()) return std::nullopt;
    shares += more;
    fitted.specific_force_mps2 = measured.specific_force_mps2 + errors * shares;
    fitted.specific_force_covariance = errors * sum.information.inverse() * errors.transpose();
    if ((shape->errors_mm() * more).cwiseAbs().maxCoeff() < kSettledFitMm * LengthUnit(shape->model())) break;
  }
  if (IsAttitudeUnknown(measured)) MeasureGravity(fitted);
  return fitted;
}

}  // namespace taclink

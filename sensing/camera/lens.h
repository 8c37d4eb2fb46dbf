#pragma once

#include <Eigen/Core>
#include <optional>

#include "sensing/core/camera_model.h"

namespace taclink {

/// What both lens models are fitted by: the focal length, then k1 and k2 (division) or k1 ... k4 (Kannala and
/// Brandt), in the units of LensModel.
inline constexpr int kMaxLensParameters = 5;
using LensParameters = Eigen::Matrix<double, kMaxLensParameters, 1>;

constexpr int LensParameterCount(LensKind kind) {
  return kind == LensKind::kDivision ? 3 : 5;
}
/// The last ones are 0 where a kind has fewer.
LensParameters ParametersOf(const LensModel& lens);
void SetParameters(const LensParameters& parameters, LensModel& lens);

/// The one interface of both lens models [fitzgibbon2001], [kannala2006]: distance r in the picture against
/// the angle theta off the axis, over the part where it rises. Allocates nothing.
class Lens {
 public:
  /// Used up to `limit_px` from the principal point, or as far as r(theta) rises.
  Lens(const LensModel& model, double limit_px);

  struct Radius {
    double px = 0;
    double px_per_rad = 0;  ///< dr/dtheta
  };
  /// Of a point `across` off the axis (not negative) and `along` it, any unit. None: beyond the lens.
  std::optional<Radius> AtPoint(double across, double along) const;
  std::optional<Radius> AtAngle(double theta_rad) const;
  /// theta of a distance in the picture. None: beyond the lens.
  std::optional<double> AngleAt(double radius_px) const;

  /// dr by the parameters at a fixed theta; `radius_px` is theta's.
  LensParameters RadiusByParameters(double theta_rad, double radius_px) const;

  double max_theta_rad() const { return max_theta_rad_; }

 private:
  // Division model: tan(theta) = r / Depth(r). Solved by guarded Newton steps [press2007, section 9.4].
  double Depth(double r) const {
    const double r2 = r * r;
    return model_.focal_px * (1 + r2 * (model_.k1_per_px2 + r2 * model_.k2_per_px4));
  }
  double DepthSlope(double r) const {
    return model_.focal_px * r * (2 * model_.k1_per_px2 + 4 * r * r * model_.k2_per_px4);
  }
  Radius DivisionRadius(double sine, double cosine) const;
  // Kannala and Brandt's: r = f ThetaD(theta). Solved for theta likewise.
  double ThetaD(double theta) const;
  double ThetaDSlope(double theta) const;
  void LimitDivision(double limit_px);
  void LimitFisheye(double limit_px);

  LensModel model_;
  double max_radius_px_ = 0, max_theta_rad_ = 0;
  double max_sine_ = 0, max_cosine_ = 1;  // of max_theta_rad_
};

/// The lens of another kind with the same focal length and principal point that is nearest to `lens` up to
/// the angle `theta_rad` (linear least squares of its k's). The lens itself if it is of that kind.
LensModel ConvertLens(const LensModel& lens, LensKind kind, double theta_rad);

}  // namespace taclink

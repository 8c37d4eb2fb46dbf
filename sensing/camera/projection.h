#pragma once

#include <array>
#include <optional>

#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// Projects points through a CameraModel and back. Cheap to copy; constant after construction.
class Projector {
 public:
  explicit Projector(const CameraModel& camera);

  /// Pixel of a point in the link frame (mm). None: outside what the lens model can see (the picture's edges
  /// are not checked).
  std::optional<Vec2> Project(const Vec3& p_in_link) const;

  /// The same with the derivative of the pixel by the point (2 x 3, px/mm).
  struct WithJacobian {
    Vec2 pixel;
    Eigen::Matrix<double, 2, 3> jacobian;
  };
  std::optional<WithJacobian> ProjectWithJacobian(const Vec3& p_in_link) const;

  /// Unit direction in the link frame of the ray that a pixel sees; None: outside the lens model.
  std::optional<Vec3> Ray(const Vec2& pixel) const;

  /// Where the camera is, link frame, mm.
  const Vec3& center_in_link() const { return center_in_link_; }
  const CameraModel& model() const { return camera_; }

  /// r_pinhole of (4.41) from the distance in the picture.
  double Undistort(double radius_px) const;
  /// Distance in the picture at the angle theta off the axis, and its derivative by theta. None: beyond the
  /// lens.
  std::optional<std::array<double, 2>> RadiusAtAngle(double theta_rad) const;

 private:
  CameraModel camera_;
  Vec3 center_in_link_;
  double max_radius_px_;  // the division model is used up to here
  double max_theta_rad_;
};

}  // namespace taclink

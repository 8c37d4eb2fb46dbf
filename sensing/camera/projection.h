#pragma once

#include <optional>

#include "sensing/camera/lens.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// By what a camera differs from another: turned by the rotation vector 0-2 (rad, in its own frame, after its
/// present rotation), its place moved by 3-5 (mm, link frame), its principal point by 6-7 (px), its lens'
/// parameters by 8-12 (see LensParameters).
inline constexpr int kCameraParameters = 8 + kMaxLensParameters;
using CameraStep = Eigen::Matrix<double, kCameraParameters, 1>;
constexpr int CameraParameterCount(LensKind kind) {
  return 8 + LensParameterCount(kind);
}
CameraModel Moved(const CameraModel& camera, const CameraStep& step);
/// The step from one camera to another of the same lens kind.
CameraStep StepBetween(const CameraModel& from, const CameraModel& to);

/// Projects points through a CameraModel and back. Cheap to copy; constant after construction; allocates
/// nothing.
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

  /// The same with the derivative by all of the camera's parameters too (2 x 13, px over CameraStep's units).
  struct WithCameraJacobian {
    Vec2 pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, kCameraParameters> by_camera;
  };
  std::optional<WithCameraJacobian> ProjectWithCameraJacobian(const Vec3& p_in_link) const;

  /// Unit direction in the link frame of the ray that a pixel sees; None: outside the lens model.
  std::optional<Vec3> Ray(const Vec2& pixel) const;

  /// Where the camera is, link frame, mm.
  const Vec3& center_in_link() const { return center_in_link_; }
  const CameraModel& model() const { return camera_; }
  const Lens& lens() const { return lens_; }

 private:
  // Of a point in the camera's frame, and the pixel's derivative by that point.
  std::optional<WithJacobian> InCamera(const Vec3& p, Lens::Radius& radius) const;

  CameraModel camera_;
  Vec3 center_in_link_;
  Lens lens_;
};

}  // namespace taclink

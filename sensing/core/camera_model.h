#pragma once

#include <array>

#include "sensing/core/geometry.h"

namespace taclink {

/// The two cameras of a link. `top` sits before the end z = 0 and looks along +Z, `bottom` sits behind the
/// end z = L and looks along -Z (camera 1 and camera 2 of the thesis, figure 4.1).
enum class CameraId : int { kTop = 0, kBottom = 1 };
inline constexpr int kCameraCount = 2;
inline constexpr std::array<CameraId, kCameraCount> kBothCameras = {CameraId::kTop, CameraId::kBottom};

constexpr size_t Index(CameraId id) {
  return static_cast<size_t>(id);
}
constexpr const char* Name(CameraId id) {
  return id == CameraId::kTop ? "top" : "bottom";
}

/// Fisheye lens as a pinhole behind the division distortion model, (4.3) and (4.41):
///   r_pinhole = f tan(theta) = r / (1 + k1 r^2 + k2 r^4),
/// theta the angle off the optical axis, r the distance in the picture from the principal point.
struct LensModel {
  double focal_px = 1;
  Vec2 principal_point_px = Vec2::Zero();
  double k1_per_px2 = 0;
  double k2_per_px4 = 0;
};

/// A camera in its place. Camera frame: x right and y down in the picture as the camera sends it, z forward.
struct CameraModel {
  LensModel lens;
  Rigid3 camera_from_link;  ///< mm
  int width_px = 0;
  int height_px = 0;
};

struct StereoRig {
  std::array<CameraModel, kCameraCount> cameras;

  const CameraModel& operator[](CameraId id) const { return cameras[Index(id)]; }
  CameraModel& operator[](CameraId id) { return cameras[Index(id)]; }
};

}  // namespace taclink

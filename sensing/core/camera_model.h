#pragma once

#include <array>

#include "sensing/core/geometry.h"

namespace taclink {

/// The two cameras of a link. `top` sits before the end z = 0 and looks along +Z, `bottom` sits behind the
/// end z = L and looks along -Z (camera 1 and camera 2 of [duong2021, figure 4.1]).
enum class CameraId : int { kTop = 0, kBottom = 1 };
inline constexpr int kCameraCount = 2;
inline constexpr std::array<CameraId, kCameraCount> kBothCameras = {CameraId::kTop, CameraId::kBottom};

constexpr size_t Index(CameraId id) {
  return static_cast<size_t>(id);
}
constexpr const char* Name(CameraId id) {
  return id == CameraId::kTop ? "top" : "bottom";
}

/// How a lens maps the angle theta off its axis to the distance r in the picture from the principal point.
enum class LensKind : int {
  /// A pinhole behind the division model [fitzgibbon2001] with two coefficients [duong2021, (4.3), (4.41)]:
  ///   r_pinhole = f tan(theta) = r / (1 + k1 r^2 + k2 r^4).
  kDivision = 0,
  /// The fisheye of [kannala2006] in the form of [opencv]: r = f theta (1 + k1 theta^2 + ... + k4 theta^8).
  kKannalaBrandt = 1,
};
inline constexpr std::array<const char*, 2> kLensNames = {"division", "kannala_brandt"};
constexpr const char* Name(LensKind kind) {
  return kLensNames[static_cast<size_t>(kind)];
}

/// A lens that is round about its axis, on square pixels.
struct LensModel {
  double focal_px = 1;  ///< dr/dtheta on the axis, of either kind
  Vec2 principal_point_px = Vec2::Zero();
  double k1_per_px2 = 0;  ///< of the division model
  double k2_per_px4 = 0;
  LensKind kind = LensKind::kDivision;
  std::array<double, 4> fisheye_k = {};  ///< of Kannala and Brandt's: k1 ... k4
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

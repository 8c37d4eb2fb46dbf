#include "sensing/camera/closed_form.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "sensing/camera/lens.h"

namespace taclink {
namespace {

constexpr int kDistanceRounds = 10;
constexpr double kWidestLensRad = 1.2;  // lenses of another kind are fitted up to here

// A camera on the axis. The lens is of the division kind.
struct Coaxial {
  Vec2 center_px;
  double roll_rad = 0;
  double focal_px, place_mm;  // the place is b of (4.3) and (4.4): before z = 0, or beyond it
  double k1_per_px2, k2_per_px4;
};

double PlaceOnAxis(const LinkModel& model, CameraId id) {
  const double z = model.nominal_rig[id].camera_from_link.Inverse().translation.z();
  return id == CameraId::kTop ? -z : z;
}

// Depth along the axis beyond the camera's place, as (4.3) and (4.4) count it.
double AxialZ(CameraId id, const Vec3& p) {
  return id == CameraId::kTop ? p.z() : -p.z();
}

// Linear least squares of the distance across the lines, n . (pixel - center) = r roll, repeated because n
// turns with the roll.
void FindCenterAndRoll(const Mat3& rotation, std::span<const BundleSample> samples, Coaxial& c) {
  for (int round = 0; round < kDistanceRounds; ++round) {
    Mat3 normal = Mat3::Zero();
    Vec3 right = Vec3::Zero();
    for (const BundleSample& s : samples) {
      const Vec3 d = rotation * Vec3(s.rest_mm.x(), s.rest_mm.y(), 0);
      const double line = std::atan2(d.y(), d.x()) + c.roll_rad;
      const Vec2 across(-std::sin(line), std::cos(line)), at = s.pixel - c.center_px;
      const Vec3 row(across.x(), across.y(), at.norm());
      normal += row * row.transpose();
      right += row * across.dot(at);
    }
    const Vec3 step = normal.ldlt().solve(right);
    if (!step.allFinite()) return;
    c.center_px += step.head<2>();
    c.roll_rad += step.z();
  }
}

// (4.37) for f and b with the lens known, then (4.43) for the lens with f and b known, by turns.
void FindFocalAndLens(CameraId id, std::span<const BundleSample> samples, Coaxial& c) {
  for (int round = 0; round < kDistanceRounds; ++round) {
    Mat2 normal = Mat2::Zero();
    Vec2 right = Vec2::Zero();
    for (const BundleSample& s : samples) {
      const double r2 = (s.pixel - c.center_px).squaredNorm();
      const double r = std::sqrt(r2) / (1 + r2 * (c.k1_per_px2 + r2 * c.k2_per_px4));
      const Vec2 row(s.rest_mm.head<2>().norm(), -r);
      normal += row * row.transpose();
      right += row * r * AxialZ(id, s.rest_mm);
    }
    const Vec2 focal_and_place = normal.ldlt().solve(right);
    if (!focal_and_place.allFinite() || focal_and_place[0] <= 0) return;
    c.focal_px = focal_and_place[0];
    c.place_mm = focal_and_place[1];
    normal.setZero();
    right.setZero();
    for (const BundleSample& s : samples) {
      const double seen = (s.pixel - c.center_px).norm(), unit = seen / c.focal_px;
      const double r = c.focal_px * s.rest_mm.head<2>().norm() / (c.place_mm + AxialZ(id, s.rest_mm));
      const Vec2 row(r * unit * unit, r * std::pow(unit, 4));
      normal += row * row.transpose();
      right += row * (seen - r);
    }
    const Vec2 lens = normal.ldlt().solve(right);
    if (!lens.allFinite()) return;
    c.k1_per_px2 = lens[0] / std::pow(c.focal_px, 2);
    c.k2_per_px4 = lens[1] / std::pow(c.focal_px, 4);
  }
}

CameraModel Place(const CameraModel& nominal, CameraId id, const Coaxial& c) {
  CameraModel camera = nominal;
  camera.lens.principal_point_px = c.center_px;
  const Mat3 roll(Eigen::AngleAxisd(c.roll_rad, Vec3::UnitZ()));
  camera.camera_from_link.rotation = roll * nominal.camera_from_link.rotation;
  const Vec3 center(0, 0, id == CameraId::kTop ? -c.place_mm : c.place_mm);
  camera.camera_from_link.translation = -(camera.camera_from_link.rotation * center);
  return camera;
}

}  // namespace

CameraStarts FindStarts(const LinkModel& model, CameraId id, std::span<const BundleSample> samples,
                        double place_tolerance_mm) {
  const CameraModel& nominal = model.nominal_rig[id];
  const LensModel lens = ConvertLens(nominal.lens, LensKind::kDivision, kWidestLensRad);
  const double place = PlaceOnAxis(model, id);
  Coaxial c{lens.principal_point_px, 0, lens.focal_px, place, lens.k1_per_px2, lens.k2_per_px4};
  FindCenterAndRoll(nominal.camera_from_link.rotation, samples, c);
  CameraStarts starts;
  starts.nominal = Place(nominal, id, c);
  FindFocalAndLens(id, samples, c);
  c.place_mm = std::clamp(c.place_mm, place - place_tolerance_mm, place + place_tolerance_mm);
  starts.closed_form = Place(nominal, id, c);
  starts.closed_form.lens = {c.focal_px, c.center_px, c.k1_per_px2, c.k2_per_px4};
  return starts;
}

}  // namespace taclink

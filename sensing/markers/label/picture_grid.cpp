#include "sensing/markers/label/picture_grid.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "sensing/camera/projection.h"
#include "sensing/markers/label/picture_grid_fit.h"

namespace taclink {
namespace {

// y(x) by straight lines through points of falling x, the outermost lines go on.
double Interpolate(const std::vector<double>& x, const std::vector<double>& y, double at) {
  const auto after = std::lower_bound(x.begin(), x.end(), at, std::greater<>()) - x.begin();
  const auto k = static_cast<size_t>(std::clamp<long>(after, 1, static_cast<long>(x.size()) - 1));
  return y[k - 1] + (y[k] - y[k - 1]) * (at - x[k - 1]) / (x[k] - x[k - 1]);
}

}  // namespace

PictureGrid::PictureGrid(const LinkModel& model, CameraId id) : path_pitch_(model.markers.path_pitch_rad()) {
  // Where paths lie in the picture: the axes of the link in the camera's frame, seen along the axis.
  const Mat3& rotation = model.nominal_rig[id].camera_from_link.rotation;
  for (int l = 0; l < model.markers.paths; ++l) {
    const double angle = model.PathAngle(l);
    const Vec3 d = rotation * Vec3(std::cos(angle), std::sin(angle), 0);
    picture_angles_.push_back(std::atan2(d.y(), d.x()));
  }
  const double camera_z = Projector(model.nominal_rig[id]).center_in_link().z();
  const int rings = model.markers.rings();
  for (int i = 0; i < rings; ++i) {
    const Vec3 p = model.RestMarker(model.MarkerIndex(0, id == CameraId::kTop ? i : rings - 1 - i));
    radii_mm_.push_back(p.head<2>().norm());
    distances_.push_back(std::abs(p.z() - camera_z));
    log_tans_.push_back(std::log(radii_mm_.back() / distances_.back()));
  }
}

PictureGrid::Harmonics PictureGrid::HarmonicsAt(double angle, double log_radius) const {
  const double outer = ring_log_radii_.front(), inner = ring_log_radii_.back();
  const double t = std::clamp((2 * log_radius - outer - inner) / (outer - inner), -1.2, 1.2);
  const double c = std::cos(angle), s = std::sin(angle);
  Harmonics h;
  h << c, c * t, c * t * t, s, s * t, s * t * t;
  return h;
}

PictureGrid::Place PictureGrid::PlaceOf(const Vec2& pixel) const {
  const Vec2 at = pixel - center_;
  const double angle = std::atan2(at.y(), at.x()), log_radius = std::log(std::max(at.norm(), 1e-3));
  const Harmonics h = HarmonicsAt(angle, log_radius);
  const double straight = angle - angle_terms_.dot(h);
  Place place{0, 1e9, log_radius - radius_terms_.dot(h)};
  for (size_t l = 0; l < picture_angles_.size(); ++l) {
    const double off = std::remainder(straight - PathAngle(static_cast<int>(l)), 2 * kPi) / path_pitch_;
    if (std::abs(off) < std::abs(place.off_path)) {
      place.path = static_cast<int>(l);
      place.off_path = off;
    }
  }
  return place;
}

Vec2 PictureGrid::PixelOf(int path, double off_path, double log_radius) const {
  const double ideal = PathAngle(path) + off_path * path_pitch_;
  double angle = ideal, radius = log_radius;
  for (int i = 0; i < 3; ++i) {  // the terms are small and smooth
    const Harmonics h = HarmonicsAt(angle, radius);
    angle = ideal + angle_terms_.dot(h);
    radius = log_radius + radius_terms_.dot(h);
  }
  return center_ + std::exp(radius) * Vec2(std::cos(angle), std::sin(angle));
}

double PictureGrid::TanAt(double log_radius) const {
  return std::exp(Interpolate(ring_log_radii_, log_tans_, log_radius));
}

double PictureGrid::LogRadiusAt(double tan_angle) const {
  return Interpolate(log_tans_, ring_log_radii_, std::log(std::max(tan_angle, 1e-3)));
}

Result<PictureGrid> PictureGrid::Fit(const LinkModel& model, CameraId id, const Detections& detections) {
  return GridFitter(model, id, detections).Run();
}

}  // namespace taclink

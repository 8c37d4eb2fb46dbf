#include "bench/thesis/thesis_camera.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace taclink {
namespace {

constexpr int kRounds = 20;  // the thesis needs about four
constexpr double kK1Unit = 1e-6, kK2Unit = 1e-11;
constexpr double kFarthestPx = 1500;
constexpr int kLeastMarkers = 16;

double Undistort(double seen, double k1, double k2) {
  const double seen2 = seen * seen;
  return seen / (1 + seen2 * (k1 + seen2 * k2));
}

struct Sample {
  double seen = 0;    // distance from the principal point in the picture
  double radius = 0;  // R_0 of the marker
  double z = 0;       // Z_0, positive away from the camera
};

double Rms(const ThesisCamera& camera, const std::vector<Sample>& samples) {
  double squares = 0;
  for (const Sample& s : samples) {
    const double r = Undistort(s.seen, camera.k1, camera.k2);
    const double off = r * (camera.place_mm + s.z) / camera.focal_px - s.radius;
    squares += off * off;
  }
  return std::sqrt(squares / static_cast<double>(samples.size()));
}

// (4.37) to (4.40), one camera.
bool SolveFocalAndPlace(const std::vector<Sample>& samples, ThesisCamera& camera) {
  Mat2 normal = Mat2::Zero();
  Vec2 right = Vec2::Zero();
  for (const Sample& s : samples) {
    const double r = Undistort(s.seen, camera.k1, camera.k2);
    const Vec2 row(s.radius, -r);
    normal += row * row.transpose();
    right += row * r * s.z;
  }
  const Vec2 solution = normal.ldlt().solve(right);
  if (!solution.allFinite() || solution[0] <= 0) return false;
  camera.focal_px = solution[0];
  camera.place_mm = solution[1];
  return true;
}

// (4.43), one camera.
bool SolveLens(const std::vector<Sample>& samples, ThesisCamera& camera) {
  Mat2 normal = Mat2::Zero();
  Vec2 right = Vec2::Zero();
  for (const Sample& s : samples) {
    const double r = camera.focal_px * s.radius / (camera.place_mm + s.z), seen2 = s.seen * s.seen;
    const Vec2 row(r * seen2 * kK1Unit, r * seen2 * seen2 * kK2Unit);
    normal += row * row.transpose();
    right += row * (s.seen - r);
  }
  const Vec2 solution = normal.ldlt().solve(right);
  if (!solution.allFinite()) return false;
  camera.k1 = solution[0] * kK1Unit;
  camera.k2 = solution[1] * kK2Unit;
  return true;
}

// By turns from the camera given; keeps the best round.
void Alternate(const std::vector<Sample>& samples, ThesisCamera camera, ThesisCamera& best, double& least) {
  for (int round = 0; round < kRounds; ++round) {
    if (!SolveFocalAndPlace(samples, camera)) return;
    const double rms = Rms(camera, samples);
    if (rms < least) {
      least = rms;
      best = camera;
    }
    if (!SolveLens(samples, camera)) return;
  }
}

// (4.35), (4.36): the mean of all markers. A marker whose opposite one was not seen would pull it aside, so
// the mean runs over pairs.
std::optional<Vec2> PrincipalPoint(const LinkModel& model, std::span<const MarkerObservation> rest) {
  const int paths = model.markers.paths;
  Vec2 sum = Vec2::Zero();
  int count = 0;
  for (int i = 0; i < model.markers.count(); ++i) {
    const int path = model.PathOf(i);
    if (paths % 2 != 0 || path >= paths / 2) continue;
    const auto& a = rest[static_cast<size_t>(i)];
    const auto& b = rest[static_cast<size_t>(model.MarkerIndex(path + paths / 2, model.RingOf(i)))];
    if (!a.seen || !b.seen) continue;
    sum += (a.center_px + b.center_px) / 2;
    ++count;
  }
  if (2 * count < kLeastMarkers) return std::nullopt;
  return Vec2(sum / count);
}

}  // namespace

ThesisCamera::Polar ThesisCamera::See(const Vec2& pixel) const {
  const Vec2 d = link_from_picture * (pixel - principal_px);
  return {Undistort(d.norm(), k1, k2), std::remainder(std::atan2(d.y(), d.x()) - turn_rad, 2 * kPi)};
}

std::optional<Vec2> ThesisCamera::Project(const Vec3& p_in_link) const {
  const double depth = Depth(p_in_link.z());
  if (depth <= 0) return std::nullopt;
  const double r = focal_px * p_in_link.head<2>().norm() / depth;
  double seen = 0, before = 0;
  for (; seen < kFarthestPx; seen += 1) {
    const double now = Undistort(seen, k1, k2);
    if (now < before) return std::nullopt;
    if (now >= r) break;
    before = now;
  }
  if (seen >= kFarthestPx) return std::nullopt;
  const double now = Undistort(seen, k1, k2);
  if (now > before) seen -= (now - r) / (now - before);
  const double phi = std::atan2(p_in_link.y(), p_in_link.x()) + turn_rad;
  return Vec2(principal_px + link_from_picture.transpose() * (seen * Vec2(std::cos(phi), std::sin(phi))));
}

ThesisCamera NominalThesisCamera(const LinkModel& model, CameraId id) {
  const CameraModel& nominal = model.nominal_rig[id];
  ThesisCamera camera;
  camera.id = id;
  camera.focal_px = nominal.lens.focal_px;
  const double z = nominal.camera_from_link.Inverse().translation.z();
  camera.place_mm = id == CameraId::kTop ? -z : z;
  camera.principal_px = nominal.lens.principal_point_px;
  camera.k1 = nominal.lens.k1_per_px2;
  camera.k2 = nominal.lens.k2_per_px4;
  camera.link_from_picture = nominal.camera_from_link.rotation.transpose().topLeftCorner<2, 2>();
  return camera;
}

std::optional<ThesisCamera> CalibrateThesisCamera(const LinkModel& model, CameraId id,
                                                  std::span<const MarkerObservation> rest) {
  const ThesisCamera nominal = NominalThesisCamera(model, id);
  ThesisCamera start = nominal;
  const auto principal = PrincipalPoint(model, rest);
  if (!principal) return std::nullopt;
  start.principal_px = *principal;
  std::vector<Sample> samples;
  Vec2 turn = Vec2::Zero();
  for (size_t i = 0; i < rest.size(); ++i) {
    if (!rest[i].seen) continue;
    const Vec3 p = model.RestMarker(static_cast<int>(i));
    samples.push_back(
        {(rest[i].center_px - *principal).norm(), p.head<2>().norm(), id == CameraId::kTop ? p.z() : -p.z()});
    const double off = start.See(rest[i].center_px).phi - std::atan2(p.y(), p.x());
    turn += Vec2(std::cos(off), std::sin(off));
  }
  start.turn_rad = std::atan2(turn.y(), turn.x());
  ThesisCamera best = start;
  double least = std::numeric_limits<double>::infinity();
  Alternate(samples, start, best, least);
  start.k1 = start.k2 = 0;
  Alternate(samples, start, best, least);
  return best;
}

}  // namespace taclink

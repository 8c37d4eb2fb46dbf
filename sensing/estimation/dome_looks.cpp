#include "sensing/estimation/dome_looks.h"

#include <algorithm>

#include "sensing/camera/dome.h"

namespace taclink {
namespace {

constexpr double kStillMm = 0.2;  // a motion that tilts the wall by a degree at most

}  // namespace

DomeLooks::DomeLooks(const LinkModel& model, const std::array<Vec3, kCameraCount>& cameras_mm)
    : paths_(model.markers.paths),
      rings_(model.markers.rings()),
      cameras_mm_(cameras_mm),
      rise_mm_(std::max(0.0, model.markers.center_depth_mm - model.thickness_mm)),
      rest_mm_(model.RestMarkers()),
      places_mm_(rest_mm_),
      rest_normals_(rest_mm_.size()),
      offsets_(rest_mm_.size()),
      moved_(rest_mm_.size()) {
  for (int m = 0; m < model.markers.count(); ++m) {
    const double z = model.markers.rings_z_mm[static_cast<size_t>(model.RingOf(m))];
    rest_inward_.push_back(-model.OutwardNormal(model.PathAngle(model.PathOf(m)), z));
  }
  for (const double z : {0.0, model.length_mm}) {
    for (int path = 0; path < model.markers.paths; ++path) {
      ends_mm_.push_back(model.PointAtDepth(model.PathAngle(path), z, model.markers.center_depth_mm));
    }
  }
  for (int m = 0; m < model.markers.count(); ++m) {
    const auto i = static_cast<size_t>(m);
    rest_normals_[i] = NormalAt(m);
    offsets_[i].fill(Vec3::Zero());
    Look(m, rest_inward_[i]);
  }
}

// Returns how far an offset has changed.
double DomeLooks::Look(int marker, const Vec3& inward) {
  const auto i = static_cast<size_t>(marker);
  double most = 0;
  for (size_t c = 0; c < kCameraCount; ++c) {
    const Vec3 offset = SeenOfDome(places_mm_[i], inward, rise_mm_, cameras_mm_[c]) - places_mm_[i];
    most = std::max(most, (offset - offsets_[i][c]).norm());
    offsets_[i][c] = offset;
  }
  return most;
}

// Inward, from the neighbours; the ends do not move.
Vec3 DomeLooks::NormalAt(int marker) const {
  const int paths = paths_, rings = rings_, path = marker % paths, ring = marker / paths;
  const auto at = [&](int p, int r) -> const Vec3& {
    if (r < 0) return ends_mm_[static_cast<size_t>(p)];
    if (r >= rings) return ends_mm_[static_cast<size_t>(paths + p)];
    return places_mm_[static_cast<size_t>(r * paths + p)];
  };
  const Vec3 around = at(path + 1 == paths ? 0 : path + 1, ring) - at(path == 0 ? paths - 1 : path - 1, ring);
  const Vec3 along = at(path, ring + 1) - at(path, ring - 1);
  return along.cross(around).normalized();
}

double DomeLooks::Update(const Eigen::VectorXd& u) {
  if (rise_mm_ == 0) return 0;
  const int paths = paths_, markers = paths_ * rings_;
  bool any = false;
  for (int m = 0; m < markers; ++m) {
    const auto i = static_cast<size_t>(m);
    const Vec3 place = rest_mm_[i] + u.segment<3>(3 * Eigen::Index{m});
    moved_[i] = (place - places_mm_[i]).squaredNorm() > kStillMm * kStillMm;
    if (!moved_[i]) continue;
    places_mm_[i] = place;
    any = true;
  }
  if (!any) return 0;
  double most = 0;
  for (int m = 0; m < markers; ++m) {
    const auto i = static_cast<size_t>(m);
    const int path = m % paths, first = m - path;
    const auto moved = [&](int k) { return k >= 0 && k < markers && moved_[static_cast<size_t>(k)]; };
    if (!moved(m) && !moved(m - paths) && !moved(m + paths) && !moved(first + (path + 1) % paths) &&
        !moved(first + (path + paths - 1) % paths)) {
      continue;
    }
    const Vec3 inward = (rest_inward_[i] + NormalAt(m) - rest_normals_[i]).normalized();
    most = std::max(most, Look(m, inward));
  }
  return most;
}

}  // namespace taclink

#include "sensing/camera/rest_shape.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace taclink {

Vec3 RestShape::Inward(int marker) const {
  const LinkModel& model = *model_;
  const int path = model.PathOf(marker), ring = model.RingOf(marker), paths = model.markers.paths;
  const Vec3 inward =
      -model.OutwardNormal(model.PathAngle(path), model.markers.rings_z_mm[static_cast<size_t>(ring)]);
  if (displaced_mm_.size() == 0 || model.markers.rings() < 2) return inward;
  const int before = model.MarkerIndex((path + paths - 1) % paths, ring),
            after = model.MarkerIndex((path + 1) % paths, ring),
            below = model.MarkerIndex(path, std::max(ring - 1, 0)),
            above = model.MarkerIndex(path, std::min(ring + 1, model.markers.rings() - 1));
  const Vec3 rest = (model.RestMarker(after) - model.RestMarker(before))
                        .cross(model.RestMarker(above) - model.RestMarker(below));
  const Vec3 displaced = (Marker(after) - Marker(before)).cross(Marker(above) - Marker(below));
  return Eigen::Quaterniond::FromTwoVectors(rest, displaced) * inward;
}

}  // namespace taclink

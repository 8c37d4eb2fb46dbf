#include "sensing/simulation/skin_writer.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/units.h"

namespace taclink {

double StartTruth(const Scene& scene, double time_s, SkinTruth& truth) {
  const double t = scene.SceneTime(time_s);
  truth.time_s = time_s;
  truth.frame = static_cast<uint64_t>(std::max(0.0, std::round(time_s * scene.frame_rate_hz)));
  truth.pressure_mpa = kMpaPerKpa * scene.PressureKpa(t);
  return t;
}

SkinWriter::SkinWriter(const LinkModel& model, const ShellMesh& mesh)
    : model_(model), mesh_(mesh), map_(model, mesh) {
  for (size_t i = 0; i < mesh.mid_mm.size(); ++i) {
    const Vec3 wall = mesh.mid_mm[i] - model.thickness_mm / 2 * mesh.normals[i];
    rest_wall_radius_mm_.push_back(wall.head<2>().norm());
  }
}

void SkinWriter::Write(const SkinNodes& nodes, SkinTruth& truth) const {
  WriteWall(nodes, truth.inner_wall);
  WriteMarkers(nodes, truth);
}

void SkinWriter::WriteWall(const SkinNodes& nodes, RadiusGrid& wall) const {
  wall.columns = mesh_.columns;
  wall.first_angle_rad = model_.markers.first_path_angle_rad;
  wall.radius_mm.resize(mesh_.mid_mm.size());
  wall.z_mm.resize(static_cast<size_t>(mesh_.rows));
  wall.row_min_mm.assign(static_cast<size_t>(mesh_.rows), 1e9);
  wall.largest_inward_change_mm = 0;
  for (int node = 0; node < mesh_.node_count(); ++node) {
    const auto i = static_cast<size_t>(node), row = static_cast<size_t>(mesh_.Row(node));
    const Vec3 p = nodes.mids_mm[i] - model_.thickness_mm / 2 * nodes.directors[i];
    wall.radius_mm[i] = p.head<2>().norm();
    wall.z_mm[row] = mesh_.mid_mm[i].z() - model_.thickness_mm / 2 * mesh_.normals[i].z();
    wall.row_min_mm[row] = std::min(wall.row_min_mm[row], wall.radius_mm[i]);
    wall.largest_inward_change_mm =
        std::max(wall.largest_inward_change_mm, rest_wall_radius_mm_[i] - wall.radius_mm[i]);
  }
}

void SkinWriter::WriteMarkers(const SkinNodes& nodes, SkinTruth& truth) const {
  const auto count = static_cast<size_t>(model_.markers.count());
  truth.marker_mm.resize(count);
  truth.marker_wall_mm.resize(count);
  truth.marker_normal.resize(count);
  for (size_t m = 0; m < count; ++m) {
    const auto marker = static_cast<int>(m);
    const auto node = static_cast<size_t>(map_.node(marker));
    const Vec3& director = nodes.directors[node];
    truth.marker_mm[m] = map_.Position(nodes.mids_mm, nodes.directors, marker);
    truth.marker_wall_mm[m] = nodes.mids_mm[node] - map_.HalfThickness(nodes.mids_mm, marker) * director;
    truth.marker_normal[m] = director.normalized();
  }
}

}  // namespace taclink

#include "wire/log/scene.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "wire/log/times.h"
#include "wire/log/topics.h"
#include "wire/units.h"

namespace taclink::wire::log {
namespace {

constexpr double kRedAtNewton = 0.1;            // of a nodal force
constexpr int64_t kLifetimeNs = 2'000'000'000;  // of a link that says nothing more

void FillVector(const Vec3& value, double scale, foxglove::Vector3& out) {
  out.set_x(value.x() * scale);
  out.set_y(value.y() * scale);
  out.set_z(value.z() * scale);
}

void FillRotation(const Eigen::Quaterniond& q, foxglove::Quaternion& out) {
  out.set_x(q.x());
  out.set_y(q.y());
  out.set_z(q.z());
  out.set_w(q.w());
}

void FillColor(double r, double g, double b, double a, foxglove::Color& out) {
  out.set_r(r);
  out.set_g(g);
  out.set_b(b);
  out.set_a(a);
}

foxglove::SceneEntity& Entity(const std::string& link, const char* id, int64_t utc_ns,
                              foxglove::SceneUpdate& out) {
  foxglove::SceneEntity& entity = *out.add_entities();
  Fill(utc_ns, *entity.mutable_timestamp());
  entity.set_frame_id(LinkFrameId(link));
  entity.set_id(id);
  entity.mutable_lifetime()->set_seconds(kLifetimeNs / 1'000'000'000);
  entity.set_frame_locked(true);
  return entity;
}

void FillSkin(const MarkerGrid& grid, const LinkState& state, foxglove::TriangleListPrimitive& out) {
  out.mutable_pose()->mutable_orientation()->set_w(1);
  for (size_t i = 0; i < state.shape.positions_mm.size(); ++i) {
    const Vec3 p = state.shape.positions_mm[i] * kMetresPerMm;
    foxglove::Point3& point = *out.add_points();
    point.set_x(p.x());
    point.set_y(p.y());
    point.set_z(p.z());
    const double force = i < state.forces.forces_n.size() ? state.forces.forces_n[i].norm() : 0;
    const double red = std::min(force / kRedAtNewton, 1.0), gray = state.has_forces() ? 0.75 : 0.35;
    FillColor(gray + (1 - gray) * red, gray * (1 - red), gray * (1 - red), 1, *out.add_colors());
  }
  const auto index = [&grid](int ring, int path) {
    return static_cast<uint32_t>(ring * grid.paths + path % grid.paths);
  };
  for (int ring = 0; ring + 1 < grid.rings(); ++ring) {
    for (int path = 0; path < grid.paths; ++path) {
      for (const uint32_t corner : {index(ring, path), index(ring, path + 1), index(ring + 1, path + 1)})
        out.add_indices(corner);
      for (const uint32_t corner : {index(ring, path), index(ring + 1, path + 1), index(ring + 1, path)})
        out.add_indices(corner);
    }
  }
}

void FillArrow(const Contact& contact, foxglove::ArrowPrimitive& out) {
  const double force_n = contact.force_n.norm();
  const double length_m = force_n * kArrowMetresPerNewton;
  const Vec3 direction = force_n > 0 ? Vec3(contact.force_n / force_n) : Vec3(-contact.normal);
  const double head_m = std::min(0.4 * length_m, 0.01);
  FillVector(contact.center_mm * kMetresPerMm - direction * length_m, 1,
             *out.mutable_pose()->mutable_position());
  FillRotation(Eigen::Quaterniond::FromTwoVectors(Vec3::UnitX(), direction),
               *out.mutable_pose()->mutable_orientation());
  out.set_shaft_length(length_m - head_m);
  out.set_shaft_diameter(0.003);
  out.set_head_length(head_m);
  out.set_head_diameter(0.006);
  FillColor(0.9, 0.1, 0.1, 1, *out.mutable_color());
}

}  // namespace

void Fill(const std::string& link, const MarkerGrid& grid, const LinkState& state, int64_t utc_ns,
          foxglove::SceneUpdate& out) {
  out.Clear();
  if (state.shape.positions_mm.size() != static_cast<size_t>(grid.count())) {
    foxglove::SceneEntityDeletion& deletion = *out.add_deletions();
    Fill(utc_ns, *deletion.mutable_timestamp());
    deletion.set_type(foxglove::SceneEntityDeletion::ALL);
    return;
  }
  FillSkin(grid, state, *Entity(link, "skin", utc_ns, out).add_triangles());
  foxglove::SceneEntity& contacts = Entity(link, "contacts", utc_ns, out);
  for (const Contact& contact : state.contacts) FillArrow(contact, *contacts.add_arrows());
}

void Fill(const std::string& link, const Rigid3& base_from_link, int64_t utc_ns,
          foxglove::FrameTransform& out) {
  Fill(utc_ns, *out.mutable_timestamp());
  out.set_parent_frame_id(kBaseFrameId);
  out.set_child_frame_id(LinkFrameId(link));
  FillVector(base_from_link.translation, kMetresPerMm, *out.mutable_translation());
  FillRotation(Eigen::Quaterniond(base_from_link.rotation), *out.mutable_rotation());
}

}  // namespace taclink::wire::log

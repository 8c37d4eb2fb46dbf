#include "sensing/contact/contact_finder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

// What the grid of loads makes of a centre, beyond the noise: standard deviation, of the markers' spacing. So
// that 95 % of the centres of `taclink bench accuracy` are within two standard deviations.
constexpr double kGridError = 0.1;
constexpr size_t kAtOnce = 16;  // contacts for which there is memory from the start

}  // namespace

ContactFinder::ContactFinder(const LinkModel& model, const ContactOptions& options)
    : model_(model), options_(options), open_(static_cast<size_t>(model.markers.count())) {
  const auto& grid = model_.markers;
  for (int m = 0; m < grid.count(); ++m) {
    const auto ring = static_cast<size_t>(model_.RingOf(m));
    const double below = ring > 0 ? grid.rings_z_mm[ring - 1] : 0;
    const double above = ring + 1 < grid.rings_z_mm.size() ? grid.rings_z_mm[ring + 1] : model_.length_mm;
    const double z = grid.rings_z_mm[ring];
    const double radius = model_.PointAtDepth(0, z, 0).head<2>().norm();
    areas_mm2_.push_back(radius * grid.path_pitch_rad() * (above - below) / 2 *
                         std::hypot(1.0, model_.profile.Slope(z)));
  }
  queue_.reserve(open_.size());
  previous_.reserve(kAtOnce);
  spare_.resize(kAtOnce);
  for (Contact& contact : spare_) contact.markers.reserve(open_.size());
}

void ContactFinder::Recycle(std::vector<Contact>& contacts) {
  contacts.reserve(kAtOnce);
  for (Contact& contact : contacts) {
    if (spare_.size() < kAtOnce) spare_.push_back(std::move(contact));
  }
  contacts.clear();
}

Contact ContactFinder::Fresh() {
  if (spare_.empty()) return {};
  Contact contact = std::move(spare_.back());
  spare_.pop_back();
  std::vector<int> markers = std::move(contact.markers);
  contact = {};
  contact.markers = std::move(markers);
  return contact;
}

void ContactFinder::Find(const SkinShape& shape, const NodalForces& forces, std::vector<Contact>& contacts) {
  Recycle(contacts);
  std::fill(open_.begin(), open_.end(), 0);
  for (const int m : forces.loaded) open_[static_cast<size_t>(m)] = 1;
  for (const int first : forces.loaded) {
    if (!open_[static_cast<size_t>(first)]) continue;
    Contact contact = Fresh();
    Collect(first, contact.markers);
    Describe(shape, forces, contact);
    (contact.normal_force_n >= options_.min_force_n ? contacts : spare_).push_back(std::move(contact));
  }
  std::sort(contacts.begin(), contacts.end(),
            [](const Contact& a, const Contact& b) { return a.normal_force_n > b.normal_force_n; });
  AssignIds(contacts);
}

void ContactFinder::Collect(int first, std::vector<int>& region) {
  region.clear();
  queue_.assign(1, first);
  open_[static_cast<size_t>(first)] = 0;
  const int paths = model_.markers.paths, rings = model_.markers.rings();
  while (!queue_.empty()) {
    const int m = queue_.back();
    queue_.pop_back();
    region.push_back(m);
    for (int d_ring = -1; d_ring <= 1; ++d_ring) {
      const int ring = model_.RingOf(m) + d_ring;
      if (ring < 0 || ring >= rings) continue;
      for (int d_path = -1; d_path <= 1; ++d_path) {
        const int next = model_.MarkerIndex((model_.PathOf(m) + d_path + paths) % paths, ring);
        if (!open_[static_cast<size_t>(next)]) continue;
        open_[static_cast<size_t>(next)] = 0;
        queue_.push_back(next);
      }
    }
  }
}

void ContactFinder::Describe(const SkinShape& shape, const NodalForces& forces, Contact& contact) const {
  const std::vector<int>& region = contact.markers;
  double weight = 0, path = 0, ring = 0;
  const int paths = model_.markers.paths, origin = model_.PathOf(region.front());
  for (const int m : region) {
    const Vec3& f = forces.forces_n[static_cast<size_t>(m)];
    contact.force_n += f;
    const double w = f.norm();
    // Paths are counted from the first one of the region, so that a region over path 1 has a middle.
    int from_origin = (model_.PathOf(m) - origin + paths) % paths;
    if (from_origin > paths / 2) from_origin -= paths;
    weight += w;
    path += w * from_origin;
    ring += w * model_.RingOf(m);
    contact.area_mm2 += areas_mm2_[static_cast<size_t>(m)];
  }
  path = origin + path / weight;
  ring /= weight;
  contact.center_mm = OuterPointAt(shape, path, ring);
  contact.normal =
      DeformedNormal(shape, static_cast<int>(std::lround(path)), static_cast<int>(std::lround(ring)));
  contact.normal_force_n = -contact.force_n.dot(contact.normal);

  DescribeErrors(shape, forces, weight, contact);
}

// The centre is the mean of the markers' places, weighted by the sizes of their forces: to first order,
// dc = sum_i (p_i - c) (e_i . df_i) / sum_i |f_i|, e_i along f_i.
void ContactFinder::DescribeErrors(const SkinShape& shape, const NodalForces& forces, double weight,
                                   Contact& contact) const {
  Mat3 force = Mat3::Zero(), center = Mat3::Zero();
  const auto is_outside = [&](int m) {
    return std::find(contact.markers.begin(), contact.markers.end(), m) == contact.markers.end();
  };
  const auto center_by_force = [&](int m) -> Mat3 {
    const Vec3& f = forces.forces_n[static_cast<size_t>(m)];
    const Vec3 arm = OuterPoint(shape, model_.PathOf(m), model_.RingOf(m)) - contact.center_mm;
    return arm * (f / std::max(f.norm(), 1e-12)).transpose() / weight;
  };
  for (size_t i = 0; i < forces.loaded.size(); ++i) {
    const int a = forces.loaded[i];
    if (is_outside(a)) continue;
    const Mat3 by_a = center_by_force(a);
    for (size_t j = 0; j < forces.loaded.size(); ++j) {
      const int b = forces.loaded[j];
      if (is_outside(b)) continue;
      const Mat3 joint = forces.loaded_covariance.block<3, 3>(3 * static_cast<Eigen::Index>(i),
                                                              3 * static_cast<Eigen::Index>(j));
      force += joint;
      center.noalias() += by_a * joint * center_by_force(b).transpose();
    }
  }
  const int path = model_.PathOf(contact.markers.front()), ring = model_.RingOf(contact.markers.front());
  const int next = std::min(ring + 1, model_.markers.rings() - 1);
  for (const Vec3& pitch : {Vec3(OuterPoint(shape, path + 1, ring) - OuterPoint(shape, path, ring)),
                            Vec3(OuterPoint(shape, path, next) - OuterPoint(shape, path, next - 1))}) {
    center += kGridError * kGridError * pitch * pitch.transpose();
  }
  contact.force_covariance_n2 = force;
  contact.center_covariance_mm2 = center;
}

void ContactFinder::AssignIds(std::vector<Contact>& contacts) {
  for (Contact& contact : contacts) {
    Known* nearest = nullptr;
    double best = options_.same_contact_mm;
    for (Known& old : previous_) {
      const double distance = (old.center_mm - contact.center_mm).norm();
      if (old.id != 0 && distance < best) {
        best = distance;
        nearest = &old;
      }
    }
    contact.id = nearest != nullptr ? nearest->id : next_id_++;
    if (nearest != nullptr) nearest->id = 0;  // taken
  }
  previous_.clear();
  for (const Contact& contact : contacts) previous_.push_back({contact.id, contact.center_mm});
}

Vec3 ContactFinder::DeformedNormal(const SkinShape& shape, int path, int ring) const {
  const int paths = model_.markers.paths, rings = model_.markers.rings();
  const auto at = [&](int p, int r) -> const Vec3& {
    return shape.positions_mm[static_cast<size_t>(
        model_.MarkerIndex((p % paths + paths) % paths, std::clamp(r, 0, rings - 1)))];
  };
  const Vec3 around = at(path + 1, ring) - at(path - 1, ring);
  const Vec3 along = at(path, ring + 1) - at(path, ring - 1);
  return around.cross(along).normalized();
}

Vec3 ContactFinder::OuterPoint(const SkinShape& shape, int path, int ring) const {
  const int paths = model_.markers.paths;
  const int m = model_.MarkerIndex((path % paths + paths) % paths, ring);
  return shape.positions_mm[static_cast<size_t>(m)] +
         model_.markers.center_depth_mm * DeformedNormal(shape, path, ring);
}

Vec3 ContactFinder::OuterPointAt(const SkinShape& shape, double path, double ring) const {
  const int path_0 = static_cast<int>(std::floor(path));
  const int ring_0 = std::clamp(static_cast<int>(std::floor(ring)), 0, model_.markers.rings() - 2);
  const double a = path - path_0, b = ring - ring_0;
  return (1 - a) * (1 - b) * OuterPoint(shape, path_0, ring_0) +
         a * (1 - b) * OuterPoint(shape, path_0 + 1, ring_0) +
         (1 - a) * b * OuterPoint(shape, path_0, ring_0 + 1) +
         a * b * OuterPoint(shape, path_0 + 1, ring_0 + 1);
}

}  // namespace taclink

#include "sensing/contact/contact_finder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sensing/contact/contact_writer.h"
#include "sensing/core/similar_skin.h"

namespace taclink {

ContactFinder::ContactFinder(const LinkModel& model, const ContactOptions& options)
    : model_(model),
      min_force_n_(options.min_force_n * ForceUnit(model)),
      same_contact_mm_(options.same_contact_mm * LengthUnit(model)) {}

void ContactFinder::Find(SkinEstimator& estimator, const SkinEstimate& estimate,
                         std::vector<Contact>& contacts) {
  contacts.clear();
  ContactWriter writer(estimator, estimate);
  for (const EstimatedLoad& load : estimate.loads.loads) {
    if (std::max(load.normal_force_n, load.force_n.norm()) < min_force_n_) continue;
    writer.Write(load, contacts.emplace_back());
  }
  std::sort(contacts.begin(), contacts.end(),
            [](const Contact& a, const Contact& b) { return a.normal_force_n > b.normal_force_n; });
  AssignIds(contacts);
}

void ContactFinder::FindIslands(const std::vector<Vec3>& positions_mm, const NodalForces& forces,
                                std::vector<Contact>& contacts) {
  contacts.clear();
  const int paths = model_.markers.paths, rings = model_.markers.rings();
  std::vector<char> open(forces.forces_n.size(), 0);
  for (const int m : forces.loaded) open[static_cast<size_t>(m)] = 1;
  for (const int first : forces.loaded) {
    if (!open[static_cast<size_t>(first)]) continue;
    Contact contact;
    std::vector<int> queue = {first};
    open[static_cast<size_t>(first)] = 0;
    while (!queue.empty()) {
      const int m = queue.back();
      queue.pop_back();
      contact.markers.push_back(m);
      for (int ring = std::max(0, model_.RingOf(m) - 1); ring <= std::min(rings - 1, model_.RingOf(m) + 1);
           ++ring) {
        for (int by = -1; by <= 1; ++by) {
          const int next = model_.MarkerIndex((model_.PathOf(m) + by + paths) % paths, ring);
          if (!open[static_cast<size_t>(next)]) continue;
          open[static_cast<size_t>(next)] = 0;
          queue.push_back(next);
        }
      }
    }
    for (const int m : contact.markers) {
      const Vec3& force = forces.forces_n[static_cast<size_t>(m)];
      const Vec3& at = positions_mm[static_cast<size_t>(m)];
      const Vec3 outward = Vec3(at.x(), at.y(), 0).normalized();
      const Vec3 outer = at + model_.markers.center_depth_mm * outward;
      contact.force_n += force;
      contact.center_mm += force.norm() * outer;
      contact.normal_force_n -= force.dot(outward);
      contact.moment_nmm += outer.cross(force);
      contact.area_mm2 +=
          outer.head<2>().norm() * model_.markers.path_pitch_rad() * model_.length_mm / (rings + 1);
    }
    double sum = 0;
    for (const int m : contact.markers) sum += forces.forces_n[static_cast<size_t>(m)].norm();
    contact.center_mm /= sum;
    contact.normal = Vec3(contact.center_mm.x(), contact.center_mm.y(), 0).normalized();
    std::sort(contact.markers.begin(), contact.markers.end());
    contacts.push_back(std::move(contact));
  }
  std::sort(contacts.begin(), contacts.end(),
            [](const Contact& a, const Contact& b) { return a.normal_force_n > b.normal_force_n; });
  AssignIds(contacts);
}

void ContactFinder::AssignIds(std::vector<Contact>& contacts) {
  for (Contact& contact : contacts) {
    Known* nearest = nullptr;
    double best = same_contact_mm_;
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

}  // namespace taclink

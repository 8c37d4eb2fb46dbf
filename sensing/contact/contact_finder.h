#pragma once

#include <cstdint>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"
#include "sensing/core/skin_shape.h"

namespace taclink {

struct ContactOptions {
  double min_force_n = 0.03;    ///< weaker contacts are not reported
  double same_contact_mm = 30;  ///< a contact keeps its id if its centre moved less between frames
};

/// Groups nodal forces into contacts: connected regions of loaded markers (neighbours on the grid, diagonals
/// too). Remembers the last frame's contacts for their ids. Allocates only for more contacts than there were
/// before. One thread.
class ContactFinder {
 public:
  explicit ContactFinder(const LinkModel& model, const ContactOptions& options = {});

  /// `contacts`: those of the frame before, or none; their lists' memory is reused.
  void Find(const SkinShape& shape, const NodalForces& forces, std::vector<Contact>& contacts);

 private:
  void Collect(int first, std::vector<int>& region);
  void Recycle(std::vector<Contact>& contacts);
  Contact Fresh();
  void Describe(const SkinShape& shape, const NodalForces& forces, Contact& contact) const;
  void DescribeErrors(const SkinShape& shape, const NodalForces& forces, double weight,
                      Contact& contact) const;
  void AssignIds(std::vector<Contact>& contacts);
  Vec3 DeformedNormal(const SkinShape& shape, int path, int ring) const;
  Vec3 OuterPoint(const SkinShape& shape, int path, int ring) const;
  /// Point of the deformed outer surface between the markers, bilinear in grid coordinates (from 0).
  Vec3 OuterPointAt(const SkinShape& shape, double path, double ring) const;

  LinkModel model_;
  ContactOptions options_;
  std::vector<double> areas_mm2_;  // of the undeformed outer surface that belongs to each marker

  std::vector<char> open_;  // scratch: loaded and not yet in a region
  std::vector<int> queue_;
  std::vector<Contact> spare_;  // for the memory of their lists
  struct Known {
    uint64_t id;
    Vec3 center_mm;
  };
  std::vector<Known> previous_;
  uint64_t next_id_ = 1;
};

}  // namespace taclink

#pragma once

#include <cstdint>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"
#include "sensing/estimation/skin_estimator.h"

namespace taclink {

struct ContactOptions {
  /// Weaker contacts are not reported; times E t^2 over that of the shipped cylinder.
  double min_force_n = 0.02;
  /// A contact keeps its id if its center moved less between frames; times sqrt(R t), likewise.
  double same_contact_mm = kSameContactMm;
};

/// Describes an estimate's loads as contacts, and gives them ids that last: remembers the last frame's. One
/// thread.
class ContactFinder {
 public:
  explicit ContactFinder(const LinkModel& model, const ContactOptions& options = {});

  /// `estimator` made `estimate` just now.
  void Find(SkinEstimator& estimator, const SkinEstimate& estimate, std::vector<Contact>& contacts);
  /// Islands of loaded markers: the thesis' forces know no more. Without covariances.
  void FindIslands(const std::vector<Vec3>& positions_mm, const NodalForces& forces,
                   std::vector<Contact>& contacts);

 private:
  void AssignIds(std::vector<Contact>& contacts);

  LinkModel model_;
  double min_force_n_, same_contact_mm_;
  struct Known {
    uint64_t id;
    Vec3 center_mm;
  };
  std::vector<Known> previous_;
  uint64_t next_id_ = 1;
};

}  // namespace taclink

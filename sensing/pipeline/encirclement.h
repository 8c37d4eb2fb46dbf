#pragma once

#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Contacts that press all around the skin at one place along it: one ring contact, or several of which no
/// two neighbors are further apart than 75 degrees. What they do together to an inflated skin is little
/// beside what each of them would do alone, so that their sum is less certain than a single contact's force.
struct Encirclement {
  std::vector<size_t> contacts;  ///< indices
  double normal_force_n = 0;     ///< sum
};

/// Each contact is in one of them at most.
std::vector<Encirclement> FindEncirclements(const LinkModel& model, const std::vector<Contact>& contacts);

/// Adds to the covariance of each contact of an encirclement its part of what is not known of the sum:
/// independent as they count, the variances add up to the sum's. Ring contacts bring theirs along.
/// `limit_around_n`: see NodalForces.
void AddEncirclementVariance(const LinkModel& model, double limit_around_n, std::vector<Contact>& contacts);

}  // namespace taclink

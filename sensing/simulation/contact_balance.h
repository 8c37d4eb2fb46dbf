#pragma once

#include <Eigen/Core>
#include <array>

#include "sensing/simulation/scene.h"

namespace taclink {

/// What one contact wants. Depths are along the inward normal, mm, at the contact's centre.
struct ContactDemand {
  bool by_depth = false;
  double force_n = 0;        ///< if not by_depth
  double depth_mm = 0;       ///< if by_depth, once fully pressed
  double pressed = 1;        ///< if by_depth: 0 where the skin would be without this contact, 1 at depth_mm
  double most_depth_mm = 0;  ///< where the inner wall meets the tube
};

struct ContactForce {
  double force_n = 0;
  bool limited = false;  ///< stopped by the tube
};

using ContactVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxSceneContacts, 1>;
using ContactMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxSceneContacts, kMaxSceneContacts>;
using ContactDemands = std::array<ContactDemand, kMaxSceneContacts>;
using ContactForces = std::array<ContactForce, kMaxSceneContacts>;

/// Forces of the first `free_depth_mm.size()` contacts, which influence each other through the skin.
/// `compliance_mm_per_n(i, j)`: depth at i per force of j; `free_depth_mm`: without contacts (negative:
/// inflated). No contact pulls, none goes deeper than it may.
ContactForces BalanceContacts(const ContactDemands& demands, const ContactMatrix& compliance_mm_per_n,
                              const ContactVector& free_depth_mm);

}  // namespace taclink

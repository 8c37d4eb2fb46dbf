#include "sensing/simulation/contact_balance.h"

#include <Eigen/LU>
#include <algorithm>

namespace taclink {
namespace {

constexpr double kToleranceMm = 1e-9;

struct Balance {
  const ContactMatrix& compliance;
  const ContactVector& free_depth;
  ContactVector force;  // known where not by depth
  std::array<bool, kMaxSceneContacts> by_depth{};
  std::array<double, kMaxSceneContacts> target{};

  // Solves the forces of all contacts that hold a depth, the others' forces given.
  void Solve() {
    const Eigen::Index n = force.size();
    ContactMatrix a = ContactMatrix::Identity(n, n);
    ContactVector b = force;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!by_depth[static_cast<size_t>(i)]) continue;
      a.row(i) = compliance.row(i);
      b(i) = target[static_cast<size_t>(i)] - free_depth(i);
    }
    force = a.partialPivLu().solve(b);
  }
  ContactVector Depths() const { return free_depth + compliance * force; }
};

}  // namespace

ContactForces BalanceContacts(const ContactDemands& demands, const ContactMatrix& compliance_mm_per_n,
                              const ContactVector& free_depth_mm) {
  const Eigen::Index n = free_depth_mm.size();
  Balance balance{compliance_mm_per_n, free_depth_mm, ContactVector::Zero(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const ContactDemand& demand = demands[static_cast<size_t>(i)];
    if (!demand.by_depth) balance.force(i) = demand.force_n;
  }
  const ContactVector loose = balance.Depths();  // under those that hold a force
  ContactForces result;
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<size_t>(i);
    if (!demands[k].by_depth) continue;
    const double depth = (1 - demands[k].pressed) * loose(i) + demands[k].pressed * demands[k].depth_mm;
    balance.by_depth[k] = true;
    balance.target[k] = std::min(depth, demands[k].most_depth_mm);
    result[k].limited = depth > demands[k].most_depth_mm;
  }
  // Each pass settles at least one contact. One that is too deep stops before one that would pull lets go: it
  // may only pull because of the other.
  for (Eigen::Index pass = 0; pass < 2 * n + 1; ++pass) {
    balance.Solve();
    const ContactVector depths = balance.Depths();
    bool stopped = false, released = false;
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<size_t>(i);
      if (balance.by_depth[k] || balance.force(i) <= 0) continue;
      if (depths(i) <= demands[k].most_depth_mm + kToleranceMm) continue;
      balance.by_depth[k] = true;
      balance.target[k] = demands[k].most_depth_mm;
      result[k].limited = stopped = true;
    }
    for (Eigen::Index i = 0; i < n && !stopped; ++i) {
      const auto k = static_cast<size_t>(i);
      if (!balance.by_depth[k] || balance.force(i) >= 0) continue;
      balance.by_depth[k] = false;
      balance.force(i) = 0;
      released = true;
    }
    if (!stopped && !released) break;
  }
  for (Eigen::Index i = 0; i < n; ++i)
    result[static_cast<size_t>(i)].force_n = std::max(0.0, balance.force(i));
  return result;
}

}  // namespace taclink

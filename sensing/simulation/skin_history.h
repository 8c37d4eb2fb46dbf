#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <optional>

#include "sensing/core/link_model.h"
#include "sensing/core/relaxation_filter.h"
#include "sensing/shell/disc_skin.h"

namespace taclink {

/// The history of a viscoelastic skin: the internal forces of RelaxationFilter at the shell's degrees of
/// freedom, hence quasi-linear viscoelasticity without further approximation but in time (the elastic forces
/// are linear between two calls of Advance). From a known history, the skin at the next moment has the shape
/// of the elastic DiscSkin under an elastic load: the real one and the remaining internal forces, which act
/// as dead loads on the material's nodes, both over RelaxationFilter::Instant. The wall's own softness under
/// a body (PressedSkinOptions::stiffness) and at the tube is taken as elastic, so that DiscSkin::Contacts
/// under the real load has the real forces.
///
/// A model without Relaxation has no history: loads come back as they are. Times in s, forces in N.
class SkinHistory {
 public:
  explicit SkinHistory(const LinkModel& model) : relaxation_(model.relaxation) {}

  bool any() const { return relaxation_.any(); }

  /// The elastic load of a skin on which this one has acted for long.
  SkinLoad RelaxedLoad(const SkinLoad& load) const;
  /// The elastic load at a time that is not before the last Begin or Advance.
  SkinLoad ElasticLoad(const SkinLoad& load, double time_s) const;

  /// A relaxed skin, with the internal forces of its elastic one (DiscSkin::InternalForces).
  void Begin(double time_s, const Eigen::VectorXd& elastic_n);
  /// A skin in equilibrium with these external forces at its degrees of freedom, of an unknown history.
  void Begin(double time_s, const Eigen::VectorXd& elastic_n, const Eigen::VectorXd& external_n);
  void Advance(double time_s, const Eigen::VectorXd& elastic_n);

 private:
  double Since(double time_s) const { return std::max(0.0, time_s - time_s_); }

  Relaxation relaxation_;
  std::optional<RelaxationFilter<Eigen::VectorXd>> filter_;  // none: not begun, or no relaxation
  double time_s_ = 0;
};

}  // namespace taclink

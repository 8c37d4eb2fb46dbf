#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/core/relaxation_filter.h"
#include "sensing/estimation/load_estimator.h"

namespace taclink {

/// What has acted on a skin that creeps (LinkModel::relaxation), as far as its frames tell. The estimator's
/// skin is elastic: it has the shape of the real one under elastic loads, which RelaxationFilter relates to
/// the real ones, load by load. Pressure and specific force are filtered before the estimate (Elastic), the
/// estimated contacts after it (MakeReal). Approximations: pressure acts on the deformed area, whose history
/// is taken as that of the pressure; contact forces are remembered at the markers, and a contact has the
/// memory of those within 2.5 pitches of the markers that it loads.
///
/// The one state of an estimator that the answer depends on. It begins relaxed: as if the pressure and the
/// specific force that are measured first had acted for long, and nothing else; while one is not measured, it
/// counts as unchanged. Between frames with an answer, whatever the gap, loads are taken as linear in time. A
/// model without Relaxation has no history; nothing is done then. mm, N, MPa; link frame. One thread.
class CreepHistory {
 public:
  explicit CreepHistory(const LinkModel& model);

  bool any() const { return relaxation_.any(); }
  void Forget();
  /// What pressed, not the known loads: where a baseline is taken that what presses is part of.
  void ForgetContacts() { contacts_.reset(); }

  /// Which known loads a frame measures.
  struct Measured {
    bool pressure = true, specific_force = true;
  };
  /// Begins a frame, once: the elastic skin's loads. What is not measured comes back as it is, with the creep
  /// of what was measured last. `exposure_ns`: monotonic; where it goes back, all is forgotten.
  MeasuredLoads Elastic(const MeasuredLoads& real, const Measured& measured, int64_t exposure_ns);

  /// Forces at the markers, three each, by load. Of one frame it may be asked several times; the last counts.
  using LumpedForces = std::vector<Eigen::VectorXd>;
  /// The elastic skin's loads of the frame become real ones. Their forces keep their directions, and what is
  /// not known of the shares (Relaxation::share_sigmas) goes into their covariances. A load that is mostly
  /// what a former one has left behind, and not told from none (by LoadEstimator's own limit), is left out.
  void MakeReal(const LumpedForces& elastic_n, std::vector<EstimatedLoad>& loads);
  /// Ends a frame that has an answer.
  void Advance();

  /// The loads that still hold the dents of former contacts, by marker, inward, N: what the elastic skin
  /// would have if nothing pressed now. Empty: none, or the strongest is below what matters to a baseline.
  Eigen::VectorXd ResidualInward() const;

 private:
  /// With every marker's force as one column.
  using Filter = RelaxationFilter<Eigen::VectorXd>;
  /// A load's part of what is remembered: inward, and its derivatives by the shares, N.
  struct Remembered {
    double elastic_n = 0, memory_n = 0;
    std::vector<double> by_share_n;
  };
  std::vector<Remembered> Share(const LumpedForces& elastic_n, const Eigen::VectorXd& memory_n) const;
  std::vector<int> OwnersOf(const LumpedForces& elastic_n) const;
  double Inward(const Eigen::VectorXd& forces_n, size_t marker) const {
    return forces_n.segment<3>(3 * static_cast<Eigen::Index>(marker)).dot(inward_[marker]);
  }
  double SinceContactsS() const { return 1e-9 * static_cast<double>(frame_ns_ - contacts_ns_); }

  Relaxation relaxation_;
  double reach_mm_ = 0, negligible_n_ = 0;
  std::vector<Vec3> inward_, place_mm_;  // by marker, at rest
  /// A known load since it was first measured.
  template <typename Value>
  struct Known {
    RelaxationFilter<Value> filter;
    Value real;  // as measured last
  };
  template <typename Value>
  Value ByCreep(std::optional<Known<Value>>& known, const Value& real, bool is_measured, double span_s) const;

  std::optional<Known<double>> pressure_mpa_;
  std::optional<Known<Vec3>> specific_force_mps2_;
  std::optional<Filter> contacts_;  // none: nothing has pressed yet
  int64_t frame_ns_ = 0, contacts_ns_ = 0;
  Eigen::VectorXd now_n_;  // the elastic forces of the frame in work; empty: none
};

}  // namespace taclink

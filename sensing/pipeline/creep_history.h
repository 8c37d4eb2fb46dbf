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

/// History of the loads on a creeping skin (LinkModel::relaxation), as estimated from its frames. The
/// estimator's skin is elastic: it has the real skin's shape under elastic loads, which RelaxationFilter
/// relates to the real ones, load by load. Pressure and specific force are converted before the estimate
/// (Elastic), the estimated contacts after it (MakeReal). Approximations: pressure acts on the deformed area,
/// whose history is taken as that of the pressure; contact forces are remembered at the markers, and a
/// contact has the memory within 2.5 pitches of the markers that it loads.
///
/// This is the only state of an estimator that its results depend on. It starts relaxed: as if the first
/// measured pressure and specific force had acted for long, and nothing else. A load that is not measured
/// counts as unchanged. Between frames with an answer, whatever the gap, loads are taken as linear in time. A
/// model without Relaxation has no history, and nothing is done. mm, N, MPa; link frame. One thread.
class CreepHistory {
 public:
  explicit CreepHistory(const LinkModel& model);

  bool any() const { return relaxation_.any(); }
  void Forget();
  /// Forgets the contacts, not the known loads: for a baseline that includes the present contacts.
  void ForgetContacts() { contacts_.reset(); }

  /// Known loads that a frame measures.
  struct Measured {
    bool pressure = true, specific_force = true;
  };
  /// Begins a frame; call once. Returns the elastic skin's loads. A load that is not measured is returned
  /// with the creep of its last measured value. `exposure_ns`: monotonic; if it goes back, the history is
  /// forgotten.
  MeasuredLoads Elastic(const MeasuredLoads& real, const Measured& measured, int64_t exposure_ns);

  /// Forces at the markers, three components each, by load.
  using LumpedForces = std::vector<Eigen::VectorXd>;
  /// Converts the frame's elastic loads to real ones. May be called several times for a frame; the last call
  /// counts. Forces keep their directions, and the uncertainty of the shares (Relaxation::share_sigmas)
  /// enters their covariances. A load is dropped if it is mostly the residual of a former one and not
  /// significant (LoadEstimator's own limit).
  void MakeReal(const LumpedForces& elastic_n, std::vector<EstimatedLoad>& loads);
  /// Ends a frame that has an answer.
  void Advance();

  /// Loads that still hold the dents of former contacts, by marker, inward, N: the elastic skin's loads if
  /// nothing presses now. Empty: none, or their sum is too small to affect a baseline.
  Eigen::VectorXd ResidualInward() const;

 private:
  /// Over the forces of all markers in one column.
  using Filter = RelaxationFilter<Eigen::VectorXd>;
  /// A load's part of the memory: inward force, and its derivatives by the shares, N.
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
  /// History of a known load since its first measurement.
  template <typename Value>
  struct Known {
    RelaxationFilter<Value> filter;
    Value real;  // last measured value
  };
  template <typename Value>
  Value ByCreep(std::optional<Known<Value>>& known, const Value& real, bool is_measured, double span_s) const;

  std::optional<Known<double>> pressure_mpa_;
  std::optional<Known<Vec3>> specific_force_mps2_;
  std::optional<Filter> contacts_;  // none: no contact so far
  int64_t frame_ns_ = 0, contacts_ns_ = 0;
  Eigen::VectorXd now_n_;  // elastic forces of the current frame; empty: none
};

}  // namespace taclink

#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/force/force_estimator.h"
#include "sensing/force/load_sites.h"
#include "sensing/force/marker_data.h"
#include "sensing/force/skin_tangent.h"

namespace taclink {

struct LoadFitOptions {
  double significance = 5.6;  ///< a load comes in if it explains this many standard deviations
  int max_loads = 40;
  double min_force_n = 0.03;  ///< forces below are of no interest
  double friction = 0.7;      ///< standard deviation of a contact's tangential force, of its normal force
};

/// Significance that noise alone passes in at most `per_hour` frames an hour, at `frames_per_second` and any
/// of `sites` sites (Bonferroni's bound: the true rate is lower, as neighbouring sites ask the same).
double SignificanceFor(double per_hour, double frames_per_second, int sites);

LoadFitOptions FitOptions(const ForceOptions& options, int sites);

/// No forces, buffers kept.
void ClearForces(int markers, ForceModel model, NodalForces& forces);

/// Few loads that explain displacements: minimises
///   1/2 |r - C f|^2 + s sum_j |c_j| f_j    over f >= 0, norms by the data's information,
/// by Lawson and Hanson's active set, over the sites let in. A load stays out unless it explains s standard
/// deviations. One thread; its memory is made at construction.
class LoadFit {
 public:
  LoadFit(const LoadSites& sites, int markers, const LoadFitOptions& options);

  /// No loads, data as they are: r is their residual.
  void Begin(const MarkerData& data);
  /// The site that explains most beyond the loads that are in, -1: none is significant. Of sites near markers
  /// that moved only.
  int MostSignificant(const MarkerData& data, const SkinTangent& tangent);
  /// Lets a site in with its column (stacked markers, mm/N) and a load to start from.
  void Add(const MarkerData& data, int site, const Eigen::Ref<const Eigen::VectorXd>& column, double load_n);
  bool IsFull() const { return static_cast<int>(sites_in_.size()) == load_.size(); }
  /// To the minimum over the sites that are in; those that would pull leave.
  void Optimise(double significance);
  /// Loads that the data want without the penalty, which makes all of them too small.
  void RemoveBias() { Optimise(0); }

  const std::vector<int>& sites_in() const { return sites_in_; }
  double load_n(size_t k) const { return load_[static_cast<Eigen::Index>(k)]; }
  const Eigen::VectorXd& residual_mm() const { return residual_; }

  /// Makes the data larger by what loads that are not let in made of them, stacked markers.
  void AddToData(const Eigen::VectorXd& by_mm);
  /// Adds tangential forces of the contacts. `tangential(shares, direction)`: column of a force of 1 N around
  /// (0) or along (1) the axis that the sites that are in share so.
  template <typename Tangential>
  void AddTangential(const MarkerData& data, Tangential tangential);
  /// Of the k-th load: around and along the axis, its share of its contact's. After AddTangential.
  Vec2 tangential_n(size_t k) const;
  /// Writes all into `forces` with covariance. After AddTangential.
  void Write(const MarkerData& data, NodalForces& forces);

 private:
  double NormOf(const MarkerData& data, const SkinTangent& tangent, int site);
  double LeastSquareOf(const MarkerData& data, const SkinTangent& tangent, int site) const;
  void Remove(size_t k);
  bool StepToOptimum(double significance);
  void Solve(double significance);
  void UpdateResidual();
  void FindGroups();
  void SolveSystem(Eigen::Index size, bool with_covariance);
  /// Returns the load that would pull most, -1: none.
  Eigen::Index FitTangential(const MarkerData& data);

  const LoadSites& sites_;
  LoadFitOptions options_;
  std::vector<int> sites_in_;
  std::vector<char> is_in_;
  Eigen::VectorXd load_, trial_, rhs_, norms_;  // in the order of sites_in_
  Eigen::MatrixXd columns_, weighed_, gram_, factor_;
  Eigen::VectorXd target_, residual_, weighed_residual_;
  bool weighed_is_current_ = false;
  Eigen::VectorXf search_;
  Eigen::VectorXd site_norms_;  // of this frame; negative: not known yet
  std::vector<char> near_;      // by site

  // Contacts: groups of neighbouring loads, and their tangential columns, two each.
  std::vector<int> group_;  // by load
  int groups_ = 0;
  Eigen::MatrixXd tangential_, tangential_weighed_;
  Eigen::MatrixXd system_, covariance_, to_markers_;
  Eigen::MatrixXd spread_;  // scratch
  Eigen::VectorXd totals_;  // inward, by contact, N
  Eigen::VectorXd system_rhs_, solution_, lumped_;
};

template <typename Tangential>
void LoadFit::AddTangential(const MarkerData& data, Tangential tangential) {
  // Loads that only made up for a tangential force would pull now, and leave.
  for (Eigen::Index pulling = 0; pulling >= 0;) {
    FindGroups();
    const auto n = static_cast<Eigen::Index>(sites_in_.size());
    for (int group = 0; group < groups_; ++group) {
      auto shares = trial_.head(n);
      for (Eigen::Index k = 0; k < n; ++k) {
        shares[k] = group_[static_cast<size_t>(k)] == group ? load_[k] : 0.0;
      }
      totals_[group] = shares.sum();
      shares /= totals_[group];
      for (int direction = 0; direction < 2; ++direction) {
        tangential_.col(2 * group + direction) = tangential(shares, direction);
      }
    }
    pulling = FitTangential(data);
    if (pulling >= 0) Remove(static_cast<size_t>(pulling));
  }
}

}  // namespace taclink

#pragma once

#include <span>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/shape/evidence.h"
#include "sensing/shape/shape_solver.h"
#include "sensing/shape/skin_basis.h"

namespace taclink {

struct ShapeEstimatorOptions {
  SkinBasisOptions basis;
  ShapeSolverOptions solver;
  /// A load comes in if it explains this many standard deviations, and goes below the second figure.
  double load_significance = 4.5;
  double load_kept = 2.5;
  /// A load goes where it explains so many standard deviations more.
  double load_moved = 3;
  /// An observation is dropped if it is off by more sigmas than this and that explains more than any load.
  double outlier_sigmas = 6;
  /// Standard deviation of what the linear shell can't follow, as a part of a marker's displacement, and at
  /// least.
  double slack_part = 0.005;
  double least_slack_mm = 0.01;
  /// The same round a field that came in, as a part of the displacement that it makes at its own place: loads
  /// are not points at markers.
  double slack_at_field = 0.05;
  /// Where what is left is larger than noise and slack allow over a marker and its neighbours, chi^2 per
  /// number above this, slack opens until it fits; there, nothing is called an outlier.
  double misfit_allowed = 2;
  /// Stray loads grow with the largest displacement: by their rest value every so many mm.
  double stray_doubles_at_mm = 20;
  /// They are taken to be what the last frames show, down to this part of what `basis` says.
  double least_stray = 0.1;
  /// Errors of a known pressure, and of what the linear shell makes of it, as a part of it.
  double pressure_sigma_mpa = 1e-4;
  double pressure_part = 0.1;
  double unknown_pressure_sigma_mpa = 3e-3;
  int max_rounds = 96;
};

/// Gauge pressure against the skin's stress-free state.
struct KnownPressure {
  double mpa = 0;
  bool is_measured = true;  ///< false: a guess
};

/// The most probable displacements of all markers, given a frame's evidence and the skin's mechanics: a field
/// made by few loads. Which loads are there is found by pursuit, from those of the frame before. See
/// map_shape.md. Allocates at construction only. One thread.
class ShapeEstimator {
 public:
  ShapeEstimator(const LinkModel& model, const ShapeEstimatorOptions& options);

  void Estimate(Evidence& evidence, const KnownPressure& pressure);
  /// Forgets the frames before.
  void Reset();

  const SkinBasis& basis() const { return basis_; }
  const ShapeSolver& solver() const { return solver_; }
  /// 3 a marker, own frames, mm, and their covariances.
  const Eigen::VectorXd& displacements() const { return u_; }
  std::span<const Mat3> covariances() const { return covariances_; }
  /// Loads that came in and observations that were dropped in the last call, for those who tune.
  int rounds() const { return rounds_; }

 private:
  void SetPrior(const KnownPressure& pressure);
  double StrayGrowth() const;
  void LearnStray();
  void Converge(Evidence& evidence);
  void Pursue(Evidence& evidence);
  void SetSlack();
  bool OpenSlack();
  double Neighbourhood(int marker, bool with_itself) const;
  bool Improve(Evidence& evidence);
  bool MoveLoad(size_t begin, size_t end);
  void Finish();

  const ShapeEstimatorOptions options_;
  const SkinBasis basis_;
  ShapeSolver solver_;
  std::vector<MarkerEvidence> markers_;
  Eigen::VectorXd slack_, u_;
  std::vector<double> opened_mm2_;  // by marker, slack that OpenSlack added
  std::vector<Mat3> covariances_;
  double stray2_;  // variance of the stray loads, of that in the options
  int frames_since_stray_ = 0;
  int rounds_ = 0;
  size_t turn_ = 0;      // whose place is looked at next
  bool looked_ = false;  // in this frame
};

}  // namespace taclink

#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "sensing/shape/evidence.h"
#include "sensing/shape/field_scan.h"
#include "sensing/shape/skin_basis.h"

namespace taclink {

struct ShapeSolverOptions {
  int max_fields = 72;
  /// Standard deviations of loads and bells once they are let in: as good as free.
  double load_sigma_n = 0.5;
  double bell_sigma_mm = 5;
  /// Loads are what should explain a displacement: a bell's gain counts this part.
  double bell_handicap = 0.6;
  /// Nothing that touches pulls: the gain of a load that does counts this part.
  double pull_handicap = 0.25;
  /// Information that differs by less than this part from what the factor holds is not worth a new factor;
  /// the steps still go to the true optimum.
  double stale_information = 0.1;
};

/// Gaussian estimate of the skin's displacement: known pressure's part + columns * x with independent priors
/// x ~ N(0, variance). Columns: modes of stray loads, pressure, pressure that varies along the axis, and the
/// fields that were let in. See map_shape.md. Allocates at construction only. One thread.
class ShapeSolver {
 public:
  ShapeSolver(const SkinBasis& basis, const ShapeSolverOptions& options);

  /// `stray_scale`: of the stray loads' standard deviation; `inflation_sigma_mpa`: of pressure-like loads
  /// that vary along the axis.
  void SetPrior(double pressure_mpa, double pressure_sigma_mpa, double inflation_sigma_mpa,
                double stray_scale);

  /// One Gauss-Newton step. Returns the largest change of a displacement, mm.
  double Step(std::span<const MarkerEvidence> evidence);

  struct Candidate {
    int field = -1;
    double gain = 0;  ///< by how much chi^2 falls if the field comes in
  };
  /// The field that explains most of what is left, if that may be `least`; valid at the optimum.
  Candidate BestField(std::span<const MarkerEvidence> evidence, double least);
  /// The inward load near the field `i` that explains most more in its place; after BestField.
  Candidate BestMove(size_t i);
  /// Takes the field `i` out and lets another in.
  void Move(size_t i, int field);
  /// Lets a field in; it moves nothing until the next step. False: no room.
  bool AddField(int field);
  /// Takes the least significant field out if it is within `significance` standard deviations of zero.
  bool RemoveWeakest(double significance);
  /// Forgets all fields and the estimate.
  void Reset();

  /// 3 a marker, mm, own frames.
  const Eigen::VectorXd& displacements() const { return u_; }
  const std::vector<int>& fields() const { return fields_; }
  double amplitude(size_t i) const { return x_[fixed_ + static_cast<Eigen::Index>(i)]; }
  /// Displacement that a field makes at its own marker, mm.
  double PeakMm(size_t i) const;
  /// Estimated pressure, MPa.
  double pressure_mpa() const { return pressure_mpa_ + x_[pressure_at_]; }

  struct StrayEvidence {
    double square = 0;   ///< sum of the modes' squared amplitudes
    double numbers = 0;  ///< of the modes that the evidence determines, not the prior
  };
  /// What the estimate says of the stray loads' size: their variance against SetPrior's scale of 1 is near
  /// square / numbers (MacKay, Bayesian interpolation, Neural Computation 4, 1992).
  StrayEvidence Stray();

  /// Of the displacement of each marker, without slack. Up to date for all if fields or prior have changed,
  /// else for the markers whose own information has; the others' turn comes within a few frames.
  std::span<const Mat3> Covariances();

 private:
  void Refresh(std::span<const MarkerEvidence> evidence);
  void Factorise();
  void Displace();
  void WeighFields();
  void Weigh();
  double FieldPrecision(int field) const;
  double ExactGain(int field);
  double NormLeft();
  void Renew();
  void SolveCovariances(size_t gathered);
  double Handicap(int field, double amplitude) const;
  void Remove(Eigen::Index i);
  auto Active() const { return transposed_.topRows(count_); }

  // Constant after construction.
  const SkinBasis& basis_;
  const ShapeSolverOptions options_;
  Eigen::Index modes_, pressure_at_, fixed_;
  Eigen::VectorXd field_norms_;  // by field, squared, at the first frame's information

  FieldScan scan_;
  Eigen::Index count_;          // columns in use
  Eigen::MatrixXd transposed_;  // columns' transpose: columns x 3 markers
  std::vector<int> fields_;     // of the columns from fixed_ on
  std::vector<char> is_in_;     // by field
  Eigen::VectorXd x_, precision_;
  Eigen::MatrixXd normal_;         // columns' information, without the prior
  std::vector<Mat3> information_;  // by marker, that normal_ holds
  double pressure_mpa_ = 0;
  Eigen::VectorXd u_;

  Eigen::MatrixXd factor_;  // lower Cholesky factor
  bool factor_is_stale_ = true, covariances_are_stale_ = true;
  std::vector<Mat3> covariances_;
  std::vector<char> covariance_is_stale_;  // by marker
  size_t covariance_turn_ = 0;
  std::array<size_t, 16> gathered_;  // markers whose covariances are found together

  // Scratch.
  Eigen::VectorXd pull_, correlations_, column_, weighted_, rhs_, step_, change_, unit_;
  Eigen::MatrixXd inverse_;
};

}  // namespace taclink

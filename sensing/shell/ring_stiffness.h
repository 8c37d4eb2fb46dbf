#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "sensing/shell/nonlinear_shell.h"

namespace taclink {

/// Blocks of the stiffness of a skin of revolution in a state of revolution, clamped at both ends. In
/// cylindrical coordinates (radial, tangential and axial translation, turns about the tangent and about
/// director x tangent) a column of nodes is coupled to itself by D0 and to its neighbors around by D+ and
/// D- = D+', alike everywhere: the matrix is block-circulant [davis1979]. Row by row of unknowns of one
/// column, five a node; of each row the entries from the row of nodes below to its own.
struct RingBlocks {
  static constexpr int kWidth = 2 * kNodeDofs;
  /// By row and (column - first column of the row of nodes below).
  using Banded = Eigen::Matrix<double, Eigen::Dynamic, kWidth, Eigen::RowMajor>;

  /// False: the shell has no rings(), its degrees of freedom are not those of a skin that is clamped at both
  /// ends, or its tangents at rest do not point around the axis.
  static bool Fit(const NonlinearShell& shell);
  /// Also sets the gradient of a column, in the same coordinates. Returns the energy of all, N mm. `state`:
  /// of revolution; only its first two columns of nodes are looked at.
  double Set(const NonlinearShell& shell, const ShellState& state, NonlinearShell::Loads loads,
             Eigen::VectorXd& gradient);

  /// Odd under reflection: the tangential translation and the turn about director x tangent.
  static bool IsOdd(Eigen::Index row) { return row % kNodeDofs == 1 || row % kNodeDofs == 4; }

  Banded own;              ///< D0
  Banded sum, difference;  ///< D+ + D-, D+ - D-
};

/// Cholesky factor of that stiffness. A discrete Fourier transform around the axis makes it block-diagonal,
/// with one matrix per harmonic k; theta is the angle between columns:
///   K_k = D0 + cos(k theta) (D+ + D-) + i sin(k theta) (D+ - D-),
/// Hermitian, banded and, by mirror symmetry, real once the odd unknowns are multiplied by i. Harmonics are
/// adjacent in vector lanes. The factor is computed in double precision and stored in single precision, as is
/// the solution. Immutable after Factorize; threads may share it.
class RingStiffness {
 public:
  /// `shell`: RingBlocks::Fit.
  explicit RingStiffness(const NonlinearShell& shell);

  /// False: the stiffness is not positive definite, or not finite.
  bool Factorize(const RingBlocks& blocks);

  /// By the shell's degrees of freedom.
  void Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const;

  /// The inverse, in cylindrical coordinates: its block between two columns of nodes depends on their
  /// difference alone. Blocks of the differences from 0 to columns / 2, below each other: what unit loads on
  /// a column (by column) move in the column that is so much farther around. Those of the opposite difference
  /// have the other sign where one unknown is odd and the other is not.
  Eigen::MatrixXf Inverse() const;

 private:
  static constexpr int kLanes = 8;

  void Load(const Eigen::VectorXd& rhs, std::vector<float>& by_column) const;
  void Store(const std::vector<float>& by_column, Eigen::VectorXd& x) const;
  void SolveByColumn(std::vector<float>& by_column) const;

  int columns_, rows_;      // rows of nodes that move
  int dofs_;                // of a column
  int harmonics_, blocks_;  // blocks of lanes
  int padded_columns_;
  std::vector<std::array<double, 2>> turns_;  // cosine and sine of a column's angle
  // By column and harmonic, orthonormal; by harmonic and column.
  std::vector<float> cosine_, sine_, cosine_back_, sine_back_;
  std::vector<float> factor_;            // by block, row, (row - column), lane
  std::vector<float> inverse_diagonal_;  // by block, row, lane
};

}  // namespace taclink

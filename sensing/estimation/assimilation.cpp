#include "sensing/estimation/assimilation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr double kSpringNMm = 3;  // of a marker that is seen well; times E t
constexpr double kWorthMm = 0.3;  // an observation as uncertain as this has half of it
constexpr double kLongestStepMm = 4;
constexpr double kSettledMm = 0.05;  // it is a place to linearize at
constexpr int kMostIterations = 20, kMostHalvings = 12;
constexpr double kFirstShift = 1e-4, kLargestShift = 1e3, kShiftGrowth = 8;  // of the rest Hessian's diagonal

// Slot of the lower pattern's entry (row, column).
int SlotOf(const Eigen::SparseMatrix<double>& pattern, int row, int column) {
  const int* first = pattern.innerIndexPtr() + pattern.outerIndexPtr()[column];
  const int* last = pattern.innerIndexPtr() + pattern.outerIndexPtr()[column + 1];
  return static_cast<int>(std::lower_bound(first, last, row) - pattern.innerIndexPtr());
}

}  // namespace

Assimilation::Assimilation(const SkinMechanics& mechanics)
    : mechanics_(mechanics),
      hessian_(mechanics.shell().Pattern()),
      factor_(hessian_),
      jacobian_(mechanics.markers().MakeJacobian(mechanics.shell())),
      springs_(static_cast<size_t>(mechanics.marker_count())) {
  const ShellState rest = mechanics.shell().Rest();
  mechanics.shell().Hessian(rest, {}, gradient_, hessian_);
  rest_diagonal_ = hessian_.diagonal();
  for (int i = 0; i < hessian_.cols(); ++i) diagonal_.push_back(SlotOf(hessian_, i, i));
}

// A direction's spring is as stiff as it is known; one camera leaves one direction free.
void Assimilation::SetSprings(const MarkerObservations& observed) {
  const Material& material = mechanics_.model().material;
  const double stiffness =
      kSpringNMm * material.youngs_modulus_mpa * mechanics_.model().thickness_mm / (0.1 * 3.5);
  const double worth_mm = kWorthMm * mechanics_.length_unit();
  for (size_t m = 0; m < springs_.size(); ++m) {
    if (observed.information[m].isZero()) {
      springs_[m].setZero();
      continue;
    }
    Eigen::SelfAdjointEigenSolver<Mat3> modes;
    modes.computeDirect(observed.information[m]);
    Vec3 known = modes.eigenvalues().cwiseMax(0) * worth_mm * worth_mm;
    known = stiffness * known.cwiseQuotient(known + Vec3::Ones());
    springs_[m] = modes.eigenvectors() * known.asDiagonal() * modes.eigenvectors().transpose();
  }
}

double Assimilation::Value(const ShellState& state, const NonlinearShell::Loads& loads) {
  double value = mechanics_.shell().Energy(state, loads);
  mechanics_.markers().Displacements(state, markers_mm_);
  for (size_t m = 0; m < springs_.size(); ++m) {
    const Vec3 off = markers_mm_.segment<3>(3 * static_cast<Eigen::Index>(m)) - observed_->displacement_mm[m];
    if (!springs_[m].isZero()) value += 0.5 * off.dot(springs_[m] * off);
  }
  return value;
}

bool Assimilation::FindStep(const ShellState& state, const NonlinearShell::Loads& loads) {
  const NonlinearShell& shell = mechanics_.shell();
  const MarkerMap& map = mechanics_.markers();
  shell.Hessian(state, loads, gradient_, hessian_);
  map.Displacements(state, markers_mm_);
  map.WriteJacobian(shell, state, jacobian_);
  Eigen::VectorXd pulls(markers_mm_.size());
  for (int m = 0; m < map.markers(); ++m) {
    const auto i = static_cast<size_t>(m);
    const Vec3 off = markers_mm_.segment<3>(3 * m) - observed_->displacement_mm[i];
    pulls.segment<3>(3 * m) = springs_[i].isZero() ? Vec3::Zero() : Vec3(springs_[i] * off);
    if (springs_[i].isZero()) continue;
    // The wall's thickness is held: its derivative would couple nodes that the shell's pattern does not.
    const Eigen::Matrix<double, 3, 5> own = map.OwnJacobian(state, m);
    const Eigen::Matrix<double, 5, 5> stiffness = own.transpose() * springs_[i] * own;
    const int dof = shell.Dof(map.node(m), 0);
    for (int c = 0; c < 5; ++c) {
      double* column = hessian_.valuePtr() + diagonal_[static_cast<size_t>(dof + c)];
      for (int r = c; r < 5; ++r) column[r - c] += stiffness(r, c);
    }
  }
  gradient_ += jacobian_.transpose() * pulls;
  if (!gradient_.allFinite()) return false;
  bool is_definite = factor_.Factorise(hessian_);
  double added = 0;
  for (double shift = kFirstShift; !is_definite && shift < kLargestShift; shift *= kShiftGrowth) {
    for (Eigen::Index i = 0; i < rest_diagonal_.size(); ++i)
      hessian_.valuePtr()[diagonal_[static_cast<size_t>(i)]] += (shift - added) * rest_diagonal_[i];
    added = shift;
    is_definite = factor_.Factorise(hessian_);
  }
  if (!is_definite) return false;
  factor_.Solve(gradient_, step_);
  step_ = -step_;
  return step_.allFinite();
}

AssimilationSummary Assimilation::Run(const MarkerObservations& observed, const KnownLoads& known,
                                      ShellState& state, Eigen::VectorXd& pulls_n) {
  observed_ = &observed;
  SetSprings(observed);
  const AppliedLoads applied(mechanics_, known);
  const NonlinearShell::Loads loads = applied.loads();
  const double unit = mechanics_.length_unit();
  AssimilationSummary summary;
  double value = Value(state, loads);
  const double slack = 1e-9 * (1 + std::abs(value));
  for (; summary.iterations < kMostIterations && !summary.converged; ++summary.iterations) {
    if (!FindStep(state, loads)) break;
    const double longest = step_.cwiseAbs().maxCoeff();
    double share = std::min(1.0, kLongestStepMm * unit / longest);
    bool is_lower = false;
    for (int halving = 0; halving < kMostHalvings && !is_lower; ++halving, share /= 2) {
      trial_ = state;
      mechanics_.shell().Step(share * step_, trial_);
      const double next = Value(trial_, loads);
      is_lower = std::isfinite(next) && next < value + slack;
      if (is_lower) value = next;
    }
    if (!is_lower) {
      summary.converged = longest < kLongestStepMm * unit;
      break;
    }
    std::swap(state, trial_);
    summary.converged = longest < kSettledMm * unit;
  }
  mechanics_.markers().Displacements(state, markers_mm_);
  pulls_n.setZero(markers_mm_.size());
  for (size_t m = 0; m < springs_.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    if (!springs_[m].isZero())
      pulls_n.segment<3>(at) = springs_[m] * (observed.displacement_mm[m] - markers_mm_.segment<3>(at));
  }
  return summary;
}

}  // namespace taclink

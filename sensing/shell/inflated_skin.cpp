#include "sensing/shell/inflated_skin.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "sensing/shell/node_steps.h"

namespace taclink {
namespace {

constexpr int kEven = 3;  // of a node's degrees of freedom, under reflection
constexpr std::array<Eigen::Index, kEven> kEvenDofs = {0, 2, 3};
constexpr int kMostNewtonSteps = 60, kMostNewtonHalvings = 30, kMostInflations = 64;
constexpr int kMostStepsOfAll = 150;        // of Newton's method, of all pressures on the way
constexpr double kToleranceShare = 1e-11;   // of Young's modulus times thickness squared: N
constexpr double kNoStepShare = 1e-11;      // of the thickness
constexpr double kLongestStepShare = 0.15;  // of the radius
constexpr double kMostInflationTurn = 0.5;

// One column of nodes, in cylindrical coordinates, of a state that is the same all around.
class Column {
 public:
  Column(const NonlinearShell& shell, double pressure_mpa) : shell_(shell), pressure_(pressure_mpa) {}

  /// Energy, gradient and blocks at a state.
  double Set(const ShellState& state) { return blocks_.Set(shell_, state, pressure_.loads(), gradient_); }
  const RingBlocks& blocks() const { return blocks_; }

  double LargestForce() const {
    double largest = 0;
    for (Eigen::Index i = 0; i < gradient_.size(); ++i) {
      if (!RingBlocks::IsOdd(i)) largest = std::max(largest, std::abs(gradient_[i]));
    }
    return largest;
  }
  /// Newton's step by the matrix of harmonic 0, and the energy's slope along it (of all columns). False: that
  /// is not positive definite.
  bool FindStep(Eigen::VectorXd& step, double& slope) const {
    const Eigen::Index rows = gradient_.size() / kNodeDofs;
    Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(kEven * rows, kEven * rows);
    Eigen::VectorXd force(kEven * rows);
    for (Eigen::Index row = 0; row < rows; ++row) {
      for (Eigen::Index a = 0; a < kEven; ++a) {
        const Eigen::Index i = kNodeDofs * row + kEvenDofs[static_cast<size_t>(a)];
        force[kEven * row + a] = gradient_[i];
        for (Eigen::Index below = row > 0 ? 1 : 0; below >= 0; --below) {
          for (Eigen::Index b = 0; b < kEven; ++b) {
            const Eigen::Index j = (below == 1 ? 0 : kNodeDofs) + kEvenDofs[static_cast<size_t>(b)];
            stiffness(kEven * row + a, kEven * (row - below) + b) = blocks_.own(i, j) + blocks_.sum(i, j);
          }
        }
      }
    }
    const Eigen::LLT<Eigen::MatrixXd> factor(stiffness);
    if (factor.info() != Eigen::Success) return false;
    const Eigen::VectorXd even = factor.solve(-force);
    slope = shell_.rings()->columns() * force.dot(even);
    step.setZero(gradient_.size());
    for (Eigen::Index row = 0; row < rows; ++row) {
      for (Eigen::Index a = 0; a < kEven; ++a)
        step[kNodeDofs * row + kEvenDofs[static_cast<size_t>(a)]] = even[kEven * row + a];
    }
    return even.allFinite();
  }

 private:
  const NonlinearShell& shell_;
  PressureLoads pressure_;
  RingBlocks blocks_;
  Eigen::VectorXd gradient_;
};

Vec3 Turned(const Vec3& v, double cosine, double sine) {
  return {cosine * v.x() - sine * v.y(), sine * v.x() + cosine * v.y(), v.z()};
}

// Moves the nodes of the first column, and those of `columns` as these.
void Move(const NonlinearShell& shell, double share, const Eigen::VectorXd& step, int columns,
          ShellState& state) {
  const int around = shell.rings()->columns();
  const auto angle_of = [&](int column) {
    const Vec3& at = shell.surface().mids_mm[static_cast<size_t>(column)];
    return std::atan2(at.y(), at.x());
  };
  const double first = angle_of(0), cosine = std::cos(first), sine = std::sin(first);
  for (int row = 1; row + 1 < shell.rings()->rows(); ++row) {
    const Eigen::Index at = kNodeDofs * (row - 1);
    const int node = row * around;
    Eigen::Matrix<double, kNodeDofs, 1> by = share * step.segment<kNodeDofs>(at);
    by.head<3>() = Turned(by.head<3>(), cosine, sine);
    shell.StepNode(node, by, state);
  }
  for (int column = 1; column < columns; ++column) {
    const double angle = angle_of(column) - first, c = std::cos(angle), s = std::sin(angle);
    for (int row = 1; row + 1 < shell.rings()->rows(); ++row) {
      const auto from = static_cast<size_t>(row * around), to = from + static_cast<size_t>(column);
      state.mids_mm[to] = Turned(state.mids_mm[from], c, s);
      state.directors[to] = Turned(state.directors[from], c, s);
      state.tangents[to] = Turned(state.tangents[from], c, s);
    }
  }
}

// Newton's method from a state nearby, in at most `left` steps; `column` is then of where it ends. False: it
// finds no equilibrium.
bool Settle(const NonlinearShell& shell, Column& column, int& left, ShellState& state) {
  const double modulus_mpa = shell.material().youngs_modulus_mpa, thickness_mm = shell.surface().thickness_mm;
  const double tolerance_n = kToleranceShare * modulus_mpa * thickness_mm * thickness_mm;
  const double longest_mm = kLongestStepShare * shell.surface().mids_mm.front().head<2>().norm();
  double energy_nmm = column.Set(state);
  Eigen::VectorXd step;
  for (int iteration = 0; iteration < kMostNewtonSteps && left > 0; ++iteration, --left) {
    if (column.LargestForce() <= tolerance_n) return true;
    double slope = 0;
    if (!column.FindStep(step, slope)) return false;
    if (LongestTranslation(step) < kNoStepShare * thickness_mm) return true;  // forces of a foil are rounded
    double share = ShareWithin(step, longest_mm, kMostInflationTurn);
    // Below what the energy resolves, a step is taken on trust.
    const double noise = 1e-12 * std::abs(energy_nmm) + 1e-13 * modulus_mpa * std::pow(thickness_mm, 3);
    for (int halving = 0;; ++halving, share /= 2) {
      ShellState trial = state;
      Move(shell, share, step, 2, trial);
      const double trial_nmm = column.Set(trial);
      if (trial_nmm <= energy_nmm + 1e-4 * share * slope + noise) {
        state = std::move(trial);
        energy_nmm = trial_nmm;
        break;
      }
      if (halving == kMostNewtonHalvings) return false;
    }
  }
  return false;
}

}  // namespace

// At once or, where the slack skin would not stand that pressure, in steps.
std::optional<InflatedSkin> Inflate(const NonlinearShell& shell, double pressure_mpa) {
  assert(RingBlocks::Fit(shell));
  int left = kMostStepsOfAll;
  for (int steps = 1; steps <= kMostInflations && left > 0; steps *= 4) {
    ShellState state = shell.Rest();
    std::optional<Column> column;
    bool stands = true;
    for (int step = 1; step <= steps && stands; ++step) {
      column.emplace(shell, pressure_mpa * step / steps);
      stands = Settle(shell, *column, left, state);
    }
    if (!stands) continue;
    const int columns = shell.rings()->columns();
    Move(shell, 0, Eigen::VectorXd::Zero(kNodeDofs * (shell.rings()->rows() - 2)), columns, state);
    InflatedSkin skin{pressure_mpa, std::move(state), RingStiffness(shell)};
    if (!skin.stiffness.Factorize(column->blocks())) return std::nullopt;
    return skin;
  }
  return std::nullopt;
}

}  // namespace taclink

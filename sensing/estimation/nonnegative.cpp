#include "sensing/estimation/nonnegative.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

// Of the diagonal: neighbouring loads displace nearly alike, and a factor must exist.
template <typename Scalar>
constexpr double kRidge = 1e-9;
template <>
constexpr double kRidge<float> = 1e-6;
constexpr double kTolerance = 1e-9;
// What needs more is no load of a few bodies, and would keep a link from its next frame.
constexpr int kMostSolutions = 500;
constexpr size_t kMostVariables = 150;

}  // namespace

// False: it depends on those that are in, by rounding.
template <typename Matrix>
bool NonNegativeSolver::Append(const Matrix& h, int variable) {
  const auto k = static_cast<Eigen::Index>(in_.size());
  if (factor_.rows() <= k) factor_.conservativeResize(2 * k + 32, 2 * k + 32);
  auto row = factor_.row(k).head(k);
  for (Eigen::Index i = 0; i < k; ++i) row[i] = h(variable, in_[static_cast<size_t>(i)]);
  factor_.topLeftCorner(k, k).triangularView<Eigen::Lower>().solveInPlace(row.transpose());
  const double ridge = kRidge<typename Matrix::Scalar> * h(variable, variable);
  const double left = h(variable, variable) + ridge - row.squaredNorm();
  if (!(left > 0)) return false;
  factor_(k, k) = std::sqrt(left);
  in_.push_back(variable);
  return true;
}

template <typename Matrix>
void NonNegativeSolver::Refactor(const Matrix& h, size_t from) {
  const std::vector<int> again(in_.begin() + static_cast<std::ptrdiff_t>(from), in_.end());
  in_.resize(from);
  for (const int variable : again) {
    if (Append(h, variable)) continue;
    is_in_[static_cast<size_t>(variable)] = 0;
    x_[variable] = 0;
  }
}

void NonNegativeSolver::SolveOnSupport(const Eigen::VectorXd& b) {
  const auto k = static_cast<Eigen::Index>(in_.size());
  trial_.resize(k);
  for (Eigen::Index i = 0; i < k; ++i) trial_[i] = b[in_[static_cast<size_t>(i)]];
  const auto lower = factor_.topLeftCorner(k, k).triangularView<Eigen::Lower>();
  lower.solveInPlace(trial_);
  lower.transpose().solveInPlace(trial_);
  ++work_;
}

// To the minimum over the variables that are in; those that would go below zero leave. False: they take
// turns.
template <typename Matrix>
bool NonNegativeSolver::StepToOptimum(const Matrix& h, const Eigen::VectorXd& b) {
  while (!in_.empty()) {
    if (work_ > kMostSolutions || in_.size() > kMostVariables) return false;
    SolveOnSupport(b);
    double share = 1;
    size_t first_out = in_.size();
    for (size_t i = 0; i < in_.size(); ++i) {
      const double value = x_[in_[i]], to = trial_[static_cast<Eigen::Index>(i)];
      if (to > 0) continue;
      const double reach = value / std::max(value - to, 1e-300);
      if (first_out == in_.size() || reach < share) {
        share = std::min(share, reach);
        first_out = i;
      }
    }
    for (size_t i = 0; i < in_.size(); ++i) {
      double& value = x_[in_[i]];
      value += share * (trial_[static_cast<Eigen::Index>(i)] - value);
    }
    if (first_out == in_.size()) return true;
    x_[in_[first_out]] = 0;
    is_in_[static_cast<size_t>(in_[first_out])] = 0;
    in_.erase(in_.begin() + static_cast<std::ptrdiff_t>(first_out));
    Refactor(h, first_out);
  }
  return true;
}

template <typename Matrix>
const Eigen::VectorXd& NonNegativeSolver::Solve(const Matrix& h, const Eigen::VectorXd& b,
                                                std::vector<int>& support) {
  const Eigen::Index n = b.size();
  x_.setZero(n);
  is_in_.assign(static_cast<size_t>(n), 0);
  in_.clear();
  work_ = 0;
  for (const int variable : support) {
    if (Append(h, variable)) is_in_[static_cast<size_t>(variable)] = 1;
  }
  const double tolerance = kTolerance * (n > 0 ? std::max(1.0, b.cwiseAbs().maxCoeff()) : 1);
  converged_ = StepToOptimum(h, b);
  refused_.clear();
  while (converged_) {
    gradient_ = b;
    for (const int variable : in_) gradient_ -= x_[variable] * h.col(variable).template cast<double>();
    for (const int variable : in_) gradient_[variable] = -1;
    for (const int variable : refused_) gradient_[variable] = -1;
    Eigen::Index best = 0;
    if (n == 0 || gradient_.maxCoeff(&best) <= tolerance) break;
    const auto variable = static_cast<int>(best);
    if (!Append(h, variable)) {
      refused_.push_back(variable);
      continue;
    }
    is_in_[static_cast<size_t>(variable)] = 1;
    converged_ = StepToOptimum(h, b);
    // By rounding it leaves at once.
    if (!is_in_[static_cast<size_t>(variable)])
      refused_.push_back(variable);
    else
      refused_.clear();
  }
  support = in_;
  return x_;
}

template const Eigen::VectorXd& NonNegativeSolver::Solve(const Eigen::MatrixXd&, const Eigen::VectorXd&,
                                                         std::vector<int>&);
template const Eigen::VectorXd& NonNegativeSolver::Solve(const Eigen::MatrixXf&, const Eigen::VectorXd&,
                                                         std::vector<int>&);

}  // namespace taclink

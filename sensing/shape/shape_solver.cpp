#include "sensing/shape/shape_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace taclink {
namespace {

constexpr int kTried = 3;  // loads and bells, each, of the scan whose gain is computed exactly
constexpr double kLeastVariance = 1e-18;

}  // namespace

ShapeSolver::ShapeSolver(const SkinBasis& basis, const ShapeSolverOptions& options)
    : basis_(basis),
      options_(options),
      modes_(basis.modes().cols()),
      pressure_at_(modes_),
      fixed_(modes_ + 1 + basis.inflation().cols()),
      scan_(basis),
      count_(fixed_),
      is_in_(static_cast<size_t>(basis.fields()), 0) {
  const Eigen::Index n = 3 * basis.markers(), most = fixed_ + options.max_fields;
  transposed_ = Eigen::MatrixXd::Zero(most, n);
  transposed_.topRows(modes_) = basis.modes().transpose();
  transposed_.row(pressure_at_) = basis.per_pressure().transpose();
  transposed_.middleRows(pressure_at_ + 1, basis.inflation().cols()) = basis.inflation().transpose();
  field_norms_.setZero(basis.fields());
  column_.resize(n);
  fields_.reserve(static_cast<size_t>(options.max_fields));
  x_ = Eigen::VectorXd::Zero(most);
  precision_ = Eigen::VectorXd::Ones(most);
  normal_ = Eigen::MatrixXd::Zero(most, most);
  factor_ = normal_;
  inverse_ = normal_;
  information_.assign(static_cast<size_t>(basis.markers()), Mat3::Zero());
  covariances_ = information_;
  for (Eigen::VectorXd* v : {&u_, &pull_, &correlations_, &weighted_, &change_}) v->setZero(n);
  for (Eigen::VectorXd* v : {&rhs_, &step_}) v->setZero(most);
}

void ShapeSolver::SetPrior(double pressure_mpa, double pressure_sigma_mpa, double inflation_sigma_mpa,
                           double stray_scale) {
  pressure_mpa_ = pressure_mpa;
  const auto precision = [](double sigma) { return 1 / std::max(sigma * sigma, kLeastVariance); };
  const double old_mode = precision_[0], old_pressure = precision_[pressure_at_];
  precision_.head(modes_).setConstant(precision(stray_scale));
  precision_[pressure_at_] = precision(pressure_sigma_mpa);
  precision_.segment(pressure_at_ + 1, fixed_ - modes_ - 1).setConstant(precision(inflation_sigma_mpa));
  if (std::abs(precision_[0] - old_mode) > options_.stale_information * old_mode ||
      std::abs(precision_[pressure_at_] - old_pressure) > options_.stale_information * old_pressure) {
    factor_is_stale_ = true;
  }
  Displace();
}

double ShapeSolver::PeakMm(size_t i) const {
  const auto row = fixed_ + static_cast<Eigen::Index>(i);
  return transposed_.block<1, 3>(row, 3 * basis_.MarkerOf(fields_[i])).norm() * std::abs(x_[row]);
}

void ShapeSolver::Displace() {
  u_.noalias() = Active().transpose() * x_.head(count_);
  u_ += pressure_mpa_ * basis_.per_pressure();
}

void ShapeSolver::Refresh(std::span<const MarkerEvidence> evidence) {
  for (size_t m = 0; m < evidence.size(); ++m) {
    const Mat3 change = evidence[m].information - information_[m];
    if (change.cwiseAbs().maxCoeff() <= options_.stale_information * information_[m].trace() / 3) continue;
    const auto block = transposed_.block(0, 3 * static_cast<Eigen::Index>(m), count_, 3);
    const auto weighted = inverse_.topLeftCorner(count_, 3);
    inverse_.topLeftCorner(count_, 3).noalias() = block.lazyProduct(change);
    for (Eigen::Index k = 0; k < count_; ++k) {
      const Eigen::Index below = count_ - k;
      normal_.col(k).segment(k, below) += block(k, 0) * weighted.col(0).tail(below) +
                                          block(k, 1) * weighted.col(1).tail(below) +
                                          block(k, 2) * weighted.col(2).tail(below);
    }
    information_[m] = evidence[m].information;
    factor_is_stale_ = true;
  }
}

void ShapeSolver::Factorise() {
  auto factor = factor_.topLeftCorner(count_, count_);
  factor.triangularView<Eigen::Lower>() = normal_.topLeftCorner(count_, count_);
  factor.diagonal() += precision_.head(count_);
  for (Eigen::Index k = 0; k < count_; ++k) {
    const Eigen::Index below = count_ - k - 1;
    const double pivot = std::sqrt(std::max(factor(k, k), 1e-12 * (normal_(k, k) + precision_[k])));
    factor(k, k) = pivot;
    factor.col(k).tail(below) /= pivot;
    for (Eigen::Index j = k + 1; j < count_; ++j) {
      factor.col(j).tail(count_ - j) -= factor(j, k) * factor.col(k).tail(count_ - j);
    }
  }
  factor_is_stale_ = false;
  covariances_are_stale_ = true;
}

// Only to find candidates: those of the first path stand for all.
void ShapeSolver::WeighFields() {
  for (int field = 0; field < basis_.fields(); ++field) {
    const int first = basis_.OnFirstPath(field);
    if (field != first) {
      field_norms_[field] = field_norms_[first];
      continue;
    }
    basis_.WriteField(field, column_);
    Weigh();
    field_norms_[field] = std::sqrt(std::max(column_.dot(weighted_), kLeastVariance));
  }
}

void ShapeSolver::Weigh() {
  for (size_t m = 0; m < information_.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    weighted_.segment<3>(at).noalias() = information_[m] * column_.segment<3>(at);
  }
}

double ShapeSolver::Step(std::span<const MarkerEvidence> evidence) {
  Refresh(evidence);
  if (field_norms_[0] == 0) WeighFields();
  if (factor_is_stale_) Factorise();
  for (size_t m = 0; m < evidence.size(); ++m)
    pull_.segment<3>(3 * static_cast<Eigen::Index>(m)) = evidence[m].pull;
  auto step = step_.head(count_);
  step.noalias() = Active() * pull_;
  step -= precision_.head(count_).cwiseProduct(x_.head(count_));
  const auto factor = factor_.topLeftCorner(count_, count_).triangularView<Eigen::Lower>();
  factor.solveInPlace(step);
  factor.transpose().solveInPlace(step);
  x_.head(count_) += step;
  change_ = u_;
  Displace();
  return (u_ - change_).cwiseAbs().maxCoeff();
}

double ShapeSolver::FieldPrecision(int field) const {
  const double sigma = basis_.IsLoad(field) ? options_.load_sigma_n : options_.bell_sigma_mm;
  return 1 / (sigma * sigma);
}

// The chi^2 that a field takes away is s^2 / n^2, s its column's product with what pulls, n the column's norm
// after the others have had their share.
double ShapeSolver::ExactGain(int field) {
  basis_.WriteField(field, column_);
  Weigh();
  auto rhs = rhs_.head(count_);
  rhs.noalias() = Active() * weighted_;
  factor_.topLeftCorner(count_, count_).triangularView<Eigen::Lower>().solveInPlace(rhs);
  const double norm2 = column_.dot(weighted_) - rhs.squaredNorm();
  const double prior = FieldPrecision(field), s = correlations_[field];
  return s * s / (std::max(norm2, 0.0) + prior);
}

ShapeSolver::Candidate ShapeSolver::BestField(std::span<const MarkerEvidence> evidence) {
  for (size_t m = 0; m < evidence.size(); ++m)
    pull_.segment<3>(3 * static_cast<Eigen::Index>(m)) = evidence[m].pull;
  scan_.Correlate(pull_, correlations_);
  Candidate best;
  for (const bool loads : {true, false}) {
    std::array<Candidate, kTried> tried;
    const int begin = loads ? 0 : basis_.loads(), end = loads ? basis_.loads() : basis_.fields();
    for (int field = begin; field < end; ++field) {
      if (is_in_[static_cast<size_t>(field)]) continue;
      Candidate next{field, std::abs(correlations_[field]) / field_norms_[field]};
      for (Candidate& slot : tried) {
        if (next.gain > slot.gain) std::swap(slot, next);
      }
    }
    for (const Candidate& slot : tried) {
      if (slot.field < 0) continue;
      const double gain = ExactGain(slot.field) * (loads ? 1 : options_.bell_handicap);
      if (gain > best.gain) best = {slot.field, gain};
    }
  }
  return best;
}

bool ShapeSolver::AddField(int field) {
  if (static_cast<int>(fields_.size()) == options_.max_fields) return false;
  basis_.WriteField(field, column_);
  transposed_.row(count_) = column_.transpose();
  Weigh();
  rhs_.head(count_ + 1).noalias() = transposed_.topRows(count_ + 1) * weighted_;
  normal_.row(count_).head(count_ + 1) = rhs_.head(count_ + 1).transpose();
  x_[count_] = 0;
  precision_[count_] = FieldPrecision(field);
  fields_.push_back(field);
  is_in_[static_cast<size_t>(field)] = 1;
  ++count_;
  factor_is_stale_ = true;
  return true;
}

bool ShapeSolver::RemoveWeakest(double significance) {
  if (fields_.empty()) return false;
  if (factor_is_stale_) Factorise();
  // Variances of the loads: they are last, so only the factor's last rows matter.
  const auto n = static_cast<Eigen::Index>(fields_.size());
  auto inverse = inverse_.topLeftCorner(n, n);
  inverse.setIdentity();
  factor_.block(fixed_, fixed_, n, n).triangularView<Eigen::Lower>().solveInPlace(inverse);
  Eigen::Index weakest = -1;
  double least = significance;
  for (Eigen::Index k = 0; k < n; ++k) {
    const double ratio = std::abs(x_[fixed_ + k]) / inverse.col(k).tail(n - k).norm();
    if (ratio >= least) continue;
    least = ratio;
    weakest = k;
  }
  if (weakest < 0) return false;
  const Eigen::Index at = fixed_ + weakest, last = --count_;
  is_in_[static_cast<size_t>(fields_[static_cast<size_t>(weakest)])] = 0;
  fields_[static_cast<size_t>(weakest)] = fields_.back();
  fields_.pop_back();
  x_[at] = x_[last];
  precision_[at] = precision_[last];
  transposed_.row(at) = transposed_.row(last);
  normal_.row(at).head(at) = normal_.row(last).head(at);
  normal_.col(at).segment(at + 1, last - at) = normal_.row(last).segment(at + 1, last - at).transpose();
  normal_(at, at) = normal_(last, last);
  factor_is_stale_ = true;
  return true;
}

void ShapeSolver::Reset() {
  count_ = fixed_;
  for (const int field : fields_) is_in_[static_cast<size_t>(field)] = 0;
  fields_.clear();
  x_.setZero();
  factor_is_stale_ = true;
  Displace();
}

std::span<const Mat3> ShapeSolver::Covariances() {
  if (!covariances_are_stale_ && !factor_is_stale_) return covariances_;
  if (factor_is_stale_) Factorise();
  const auto factor = factor_.topLeftCorner(count_, count_).triangularView<Eigen::Lower>();
  auto part = inverse_.topLeftCorner(count_, 3);
  for (size_t m = 0; m < covariances_.size(); ++m) {
    part = transposed_.block(0, 3 * static_cast<Eigen::Index>(m), count_, 3);
    factor.solveInPlace(part);
    covariances_[m].noalias() = part.transpose().lazyProduct(part);
  }
  covariances_are_stale_ = false;
  return covariances_;
}

}  // namespace taclink

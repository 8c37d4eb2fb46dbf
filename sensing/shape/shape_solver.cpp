#include "sensing/shape/shape_solver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace taclink {
namespace {

constexpr int kTried = 3;               // loads and bells, each, of the scan whose gain is computed exactly
constexpr size_t kCovarianceTurns = 8;  // frames until all covariances are of the newest factor
constexpr int kTriedMoves = 5;
constexpr int kMoved = 2;           // half intervals of the markers that a field moves at once
constexpr double kPromising = 0.5;  // of the gain that counts, before fields that are in are thought of
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
  covariance_is_stale_.assign(static_cast<size_t>(basis.markers()), 1);
  information_.assign(static_cast<size_t>(basis.markers()), Mat3::Zero());
  covariances_ = information_;
  for (Eigen::VectorXd* v : {&u_, &pull_, &correlations_, &weighted_, &change_}) v->setZero(n);
  for (Eigen::VectorXd* v : {&rhs_, &step_, &unit_}) v->setZero(most);
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
    Renew();
  }
  Displace();
}

void ShapeSolver::Renew() {
  factor_is_stale_ = true;
  std::fill(covariance_is_stale_.begin(), covariance_is_stale_.end(), char{1});
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
    covariance_is_stale_[m] = 1;
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

// Only to find candidates: those of the first path stand for all. What is left of them when modes and
// pressure have had their share.
void ShapeSolver::WeighFields() {
  for (int field = 0; field < basis_.fields(); ++field) {
    const int first = basis_.OnFirstPath(field);
    if (field != first) {
      field_norms_[field] = field_norms_[first];
      continue;
    }
    basis_.WriteField(field, column_);
    field_norms_[field] = std::max(NormLeft(), kLeastVariance) + FieldPrecision(field);
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
  if (factor_is_stale_) Factorise();
  if (field_norms_[0] == 0) WeighFields();
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
  const bool bell = !basis_.IsLoad(field) && !basis_.IsWave(field);
  const double sigma = bell ? options_.bell_sigma_mm : options_.load_sigma_n;
  return 1 / (sigma * sigma);
}

double ShapeSolver::Handicap(int field, double amplitude) const {
  if (basis_.IsInward(field)) return amplitude < 0 ? options_.pull_handicap : 1;
  if (basis_.IsWave(field)) {
    const auto uniform = basis_.first_wave() + (field - basis_.first_wave()) % basis_.wave_rings();
    const bool pulls = field == uniform ? amplitude < 0 : is_in_[static_cast<size_t>(uniform)] == 0;
    return pulls ? options_.pull_handicap : 1;
  }
  return basis_.IsLoad(field) ? 1 : options_.bell_handicap;
}

// The chi^2 that a field takes away is s^2 / n^2, s its column's product with what pulls, n the column's norm
// after the others have had their share.
double ShapeSolver::ExactGain(int field) {
  basis_.WriteField(field, column_);
  const double s = correlations_[field];
  return s * s / (std::max(NormLeft(), 0.0) + FieldPrecision(field));
}

double ShapeSolver::NormLeft() {
  Weigh();
  auto rhs = rhs_.head(count_);
  rhs.noalias() = Active() * weighted_;
  factor_.topLeftCorner(count_, count_).triangularView<Eigen::Lower>().solveInPlace(rhs);
  return column_.dot(weighted_) - rhs.squaredNorm();
}

ShapeSolver::Candidate ShapeSolver::BestField(std::span<const MarkerEvidence> evidence, double least) {
  for (size_t m = 0; m < evidence.size(); ++m)
    pull_.segment<3>(3 * static_cast<Eigen::Index>(m)) = evidence[m].pull;
  scan_.Correlate(pull_, correlations_);
  Candidate best;
  const std::array<int, 4> kinds = {0, basis_.loads(), basis_.first_wave(), basis_.fields()};
  for (size_t kind = 0; kind + 1 < kinds.size(); ++kind) {
    std::array<Candidate, kTried> tried;
    const int begin = kinds[kind], end = kinds[kind + 1];
    for (int field = begin; field < end; ++field) {
      const double s = correlations_[field], promising = kPromising * least * field_norms_[field];
      if (s * s < promising || is_in_[static_cast<size_t>(field)]) continue;
      Candidate next{field, Handicap(field, s) * s * s / field_norms_[field]};
      if (next.gain < kPromising * least) continue;
      for (Candidate& slot : tried) {
        if (next.gain > slot.gain) std::swap(slot, next);
      }
    }
    for (const Candidate& slot : tried) {
      if (slot.field < 0) continue;
      const double gain = ExactGain(slot.field) * Handicap(slot.field, correlations_[slot.field]);
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
  Renew();
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
    const double part = std::sqrt(Handicap(fields_[static_cast<size_t>(k)], x_[fixed_ + k]));
    const double ratio = part * std::abs(x_[fixed_ + k]) / inverse.col(k).tail(n - k).norm();
    if (ratio >= least) continue;
    least = ratio;
    weakest = k;
  }
  if (weakest < 0) return false;
  Remove(weakest);
  return true;
}

// The last field takes its place.
void ShapeSolver::Remove(Eigen::Index i) {
  const Eigen::Index at = fixed_ + i, last = --count_;
  is_in_[static_cast<size_t>(fields_[static_cast<size_t>(i)])] = 0;
  fields_[static_cast<size_t>(i)] = fields_.back();
  fields_.pop_back();
  x_[at] = x_[last];
  precision_[at] = precision_[last];
  transposed_.row(at) = transposed_.row(last);
  normal_.row(at).head(at) = normal_.row(last).head(at);
  normal_.col(at).segment(at + 1, last - at) = normal_.row(last).segment(at + 1, last - at).transpose();
  normal_(at, at) = normal_(last, last);
  Renew();
}

// With the field j let in, x_i becomes x_i - w_i a and its variance V_i + w_i^2 / n^2, a = s / n^2 and w =
// A^-1 T^T L C_j; without i, its square over its variance comes back.
ShapeSolver::Candidate ShapeSolver::BestMove(size_t i) {
  if (factor_is_stale_) Factorise();
  const auto at = fixed_ + static_cast<Eigen::Index>(i);
  const SkinBasis::HalfGrid place = basis_.PlaceOf(fields_[i]);
  column_ = transposed_.row(at).transpose();
  Weigh();
  change_ = weighted_;
  std::array<Candidate, kTriedMoves> tried;
  for (int ring = place.ring - kMoved; ring <= place.ring + kMoved; ++ring) {
    for (int path = place.path - kMoved; path <= place.path + kMoved; ++path) {
      const int field = basis_.InwardAt({path, ring});
      if (field < 0 || is_in_[static_cast<size_t>(field)]) continue;
      basis_.WriteField(field, column_);
      Weigh();
      const double alone = correlations_[field] + column_.dot(change_) * x_[at];
      if (alone <= 0) continue;
      Candidate next{field, alone * alone / (column_.dot(weighted_) + FieldPrecision(field))};
      for (Candidate& slot : tried) {
        if (next.gain > slot.gain) std::swap(slot, next);
      }
    }
  }
  const auto factor = factor_.topLeftCorner(count_, count_).triangularView<Eigen::Lower>();
  auto unit = unit_.head(count_);
  unit.setZero();
  unit[at] = 1;
  factor.solveInPlace(unit);
  Candidate best;
  for (const Candidate& slot : tried) {
    if (slot.field < 0) continue;
    const double gain = ExactGain(slot.field), s = correlations_[slot.field];
    const double precision = s == 0 ? 0 : gain / (s * s);
    const double w = unit.dot(rhs_.head(count_));
    const double left = x_[at] - w * s * precision, variance = unit.squaredNorm() + w * w * precision;
    const double more = gain - left * left / variance;
    if (more > best.gain) best = {slot.field, more};
  }
  return best;
}

void ShapeSolver::Move(size_t i, int field) {
  Remove(static_cast<Eigen::Index>(i));
  AddField(field);
}

void ShapeSolver::Reset() {
  count_ = fixed_;
  for (const int field : fields_) is_in_[static_cast<size_t>(field)] = 0;
  fields_.clear();
  x_.setZero();
  Renew();
  Displace();
}

std::span<const Mat3> ShapeSolver::Covariances() {
  if (!covariances_are_stale_ && !factor_is_stale_) return covariances_;
  if (factor_is_stale_) Factorise();
  const size_t markers = covariances_.size();
  const size_t share = (markers + kCovarianceTurns - 1) / kCovarianceTurns;
  for (size_t i = 0; i < share; ++i) covariance_is_stale_[covariance_turn_++ % markers] = 1;
  size_t gathered = 0;
  for (size_t m = 0; m < markers; ++m) {
    if (covariance_is_stale_[m] != 0) {
      covariance_is_stale_[m] = 0;
      gathered_[gathered] = m;
      inverse_.block(0, 3 * static_cast<Eigen::Index>(gathered++), count_, 3) =
          transposed_.block(0, 3 * static_cast<Eigen::Index>(m), count_, 3);
    }
    if (gathered == gathered_.size() || (m + 1 == markers && gathered > 0)) {
      SolveCovariances(gathered);
      gathered = 0;
    }
  }
  covariances_are_stale_ = false;
  return covariances_;
}

ShapeSolver::StrayEvidence ShapeSolver::Stray() {
  if (factor_is_stale_) Factorise();
  auto inverse = inverse_.topLeftCorner(count_, modes_);
  inverse.setIdentity();
  factor_.topLeftCorner(count_, count_).triangularView<Eigen::Lower>().solveInPlace(inverse);
  StrayEvidence found;
  found.square = x_.head(modes_).squaredNorm();
  for (Eigen::Index k = 0; k < modes_; ++k) found.numbers += 1 - precision_[k] * inverse.col(k).squaredNorm();
  return found;
}

void ShapeSolver::SolveCovariances(size_t gathered) {
  auto parts = inverse_.topLeftCorner(count_, 3 * static_cast<Eigen::Index>(gathered));
  factor_.topLeftCorner(count_, count_).triangularView<Eigen::Lower>().solveInPlace(parts);
  for (size_t i = 0; i < gathered; ++i) {
    const auto part = inverse_.block(0, 3 * static_cast<Eigen::Index>(i), count_, 3);
    covariances_[gathered_[i]].noalias() = part.transpose().lazyProduct(part);
  }
}

}  // namespace taclink

#include "sensing/force/load_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

// A load between a clamped end and the first markers looks like a smaller one at these; of its significance.
constexpr double kBeyondMarkers = 0.9;
constexpr double kRidge = 1e-6;  // of the system's diagonal: neighbours on a fine grid are nearly alike

// With the widest registers that the processor has.
__attribute__((target_clones("avx512f", "avx2", "default"))) double Dot(const float* a, const float* b,
                                                                        Eigen::Index count) {
  constexpr Eigen::Index kLanes = 32;
  float sums[kLanes] = {};
  Eigen::Index i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (Eigen::Index k = 0; k < kLanes; ++k) sums[k] += a[i + k] * b[i + k];
  }
  double sum = 0;
  for (; i < count; ++i) sum += static_cast<double>(a[i] * b[i]);
  for (const float part : sums) sum += static_cast<double>(part);
  return sum;
}

// Of the norm of a site's column: the part of one marker.
double SquareAt(const MarkerData& data, const SkinTangent& tangent, int site, int marker) {
  const Vec3 g = tangent.inward_mm_n.col(site).segment<3>(Eigen::Index{3} * marker).cast<double>();
  return g.dot(data.information_per_mm2[static_cast<size_t>(marker)] * g);
}

}  // namespace

double SignificanceFor(double per_hour, double frames_per_second, int sites) {
  const double wanted = per_hour / (3600 * frames_per_second * sites);
  double low = 0, high = 40;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(middle / std::sqrt(2.0)) > wanted ? low : high) = middle;
  }
  return high;
}

LoadFitOptions FitOptions(const ForceOptions& options, int sites) {
  LoadFitOptions fit;
  fit.significance =
      options.significance > 0 ? options.significance : SignificanceFor(options.phantoms_per_hour, 30, sites);
  return fit;
}

void ClearForces(int markers, ForceModel model, NodalForces& forces) {
  forces.model = model;
  forces.forces_n.assign(static_cast<size_t>(markers), Vec3::Zero());
  forces.sigmas_n.assign(static_cast<size_t>(markers), 0.0);
  forces.loaded.clear();
  forces.loaded_covariance.setZero();
  forces.residual = 0;
  forces.converged = true;
}

LoadFit::LoadFit(const LoadSites& sites, int markers, const LoadFitOptions& options)
    : sites_(sites), options_(options) {
  const int most = std::min(options.max_loads, sites.count());
  is_in_.assign(static_cast<size_t>(sites.count()), 0);
  near_.assign(static_cast<size_t>(sites.count()), 0);
  sites_in_.reserve(static_cast<size_t>(most));
  group_.reserve(static_cast<size_t>(most));
  for (auto* v : {&load_, &trial_, &rhs_, &norms_}) v->setZero(most);
  for (auto* m : {&columns_, &weighed_}) m->setZero(3 * markers, most);
  for (auto* m : {&gram_, &factor_}) m->setZero(most, most);
  for (auto* v : {&target_, &residual_, &weighed_residual_}) v->setZero(3 * markers);
  search_.setZero(3 * markers);
  site_norms_.setZero(sites.count());
  // A site is told by up to four markers, and brings two tangential unknowns if it is alone.
  const Eigen::Index unknowns = Eigen::Index{3} * most, told = std::min<Eigen::Index>(12 * most, 3 * markers);
  for (auto* m : {&system_, &covariance_}) m->setZero(unknowns, unknowns);
  for (auto* v : {&system_rhs_, &solution_}) v->setZero(unknowns);
  to_markers_.setZero(told, unknowns);
  spread_.setZero(unknowns, std::max(unknowns, told));
  lumped_.setZero(told);
  totals_.setZero(most);
  tangential_.setZero(3 * markers, 2 * most);
  tangential_weighed_.setZero(3 * markers, 2 * most);
}

void LoadFit::Begin(const MarkerData& data) {
  for (const int site : sites_in_) is_in_[static_cast<size_t>(site)] = 0;
  sites_in_.clear();
  target_ = data.residual_mm;
  residual_ = target_;
  data.Weigh(residual_, weighed_residual_);
  weighed_is_current_ = true;
  site_norms_.setConstant(-1);
  // Candidates: near a marker that moved by more than its noise.
  constexpr double kMoved = 2.5;
  std::fill(near_.begin(), near_.end(), 0);
  const int reach = 2 * sites_.columns_per_path;
  for (int s = 0; s < sites_.count(); ++s) {
    const int marker = sites_.nearest_markers[static_cast<size_t>(s)];
    if (s % sites_.columns_per_path != 0) continue;
    const Eigen::Index at = Eigen::Index{3} * marker;
    if (residual_.segment<3>(at).dot(weighed_residual_.segment<3>(at)) < kMoved * kMoved) continue;
    for (int row = std::max(0, sites_.Row(s) - reach);
         row <= std::min(sites_.rows - 1, sites_.Row(s) + reach); ++row) {
      for (int d = -reach; d <= reach; ++d) {
        const int column = (sites_.Column(s) + d + sites_.columns) % sites_.columns;
        near_[static_cast<size_t>(row * sites_.columns + column)] = 1;
      }
    }
  }
}

double LoadFit::NormOf(const MarkerData& data, const SkinTangent& tangent, int site) {
  if (site_norms_[site] >= 0) return site_norms_[site];
  double squared = 0;
  for (size_t m = 0; m < data.information_per_mm2.size(); ++m) {
    squared += SquareAt(data, tangent, site, static_cast<int>(m));
  }
  site_norms_[site] = std::sqrt(squared);
  return site_norms_[site];
}

// No more than the square of the norm: what the markers about the site tell of it.
double LoadFit::LeastSquareOf(const MarkerData& data, const SkinTangent& tangent, int site) const {
  if (site_norms_[site] >= 0) return site_norms_[site] * site_norms_[site];
  double squared = 0;
  for (const int marker : sites_.around_markers[static_cast<size_t>(site)]) {
    squared += SquareAt(data, tangent, site, marker);
  }
  return squared;
}

int LoadFit::MostSignificant(const MarkerData& data, const SkinTangent& tangent) {
  if (!weighed_is_current_) data.Weigh(residual_, weighed_residual_);
  weighed_is_current_ = true;
  search_ = weighed_residual_.cast<float>();
  int best = -1;
  double best_score = options_.significance;
  for (int s = 0; s < sites_.count(); ++s) {
    const auto i = static_cast<size_t>(s);
    if (!near_[i] || is_in_[i]) continue;
    const double handicap = sites_.beyond_markers[i] ? kBeyondMarkers : 1;
    const double pull = handicap * Dot(tangent.inward_mm_n.col(s).data(), search_.data(), search_.size());
    if (pull <= 0 || pull * pull <= best_score * best_score * LeastSquareOf(data, tangent, s)) continue;
    const double norm = NormOf(data, tangent, s);
    if (norm > 0 && pull > best_score * norm) {
      best = s;
      best_score = pull / norm;
    }
  }
  return best;
}

void LoadFit::Add(const MarkerData& data, int site, const Eigen::Ref<const Eigen::VectorXd>& column,
                  double load_n) {
  const auto k = static_cast<Eigen::Index>(sites_in_.size());
  columns_.col(k) = column;
  data.Weigh(columns_.col(k), weighed_.col(k));
  for (Eigen::Index i = 0; i <= k; ++i) {
    gram_(k, i) = weighed_.col(k).dot(columns_.col(i));
    gram_(i, k) = gram_(k, i);
  }
  norms_[k] = std::sqrt(gram_(k, k));
  rhs_[k] = weighed_.col(k).dot(target_);
  load_[k] = load_n;
  sites_in_.push_back(site);
  is_in_[static_cast<size_t>(site)] = 1;
}

void LoadFit::Remove(size_t k) {
  const auto n = static_cast<Eigen::Index>(sites_in_.size());
  is_in_[static_cast<size_t>(sites_in_[k])] = 0;
  sites_in_.erase(sites_in_.begin() + static_cast<std::ptrdiff_t>(k));
  for (auto i = static_cast<Eigen::Index>(k); i + 1 < n; ++i) {
    columns_.col(i) = columns_.col(i + 1);
    weighed_.col(i) = weighed_.col(i + 1);
    load_[i] = load_[i + 1];
    rhs_[i] = rhs_[i + 1];
    norms_[i] = norms_[i + 1];
    for (Eigen::Index j = 0; j < n; ++j) gram_(i, j) = gram_(i + 1, j);
  }
  for (auto i = static_cast<Eigen::Index>(k); i + 1 < n; ++i) {
    for (Eigen::Index j = 0; j + 1 < n; ++j) gram_(j, i) = gram_(j, i + 1);
  }
}

// The minimum over the sites that are in, sign free, into trial_.
void LoadFit::Solve(double significance) {
  const auto n = static_cast<Eigen::Index>(sites_in_.size());
  auto factor = factor_.topLeftCorner(n, n);
  factor = gram_.topLeftCorner(n, n);
  factor.diagonal() *= 1 + kRidge;
  Eigen::Ref<Eigen::MatrixXd> in_place(factor);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(in_place);
  auto solution = trial_.head(n);
  solution = rhs_.head(n) - significance * norms_.head(n);
  const auto lower = factor.triangularView<Eigen::Lower>();
  lower.solveInPlace(solution);
  lower.transpose().solveInPlace(solution);
}

// One step of the inner loop: towards the minimum, as far as no load has to pull; that one leaves. True: the
// minimum was reached.
bool LoadFit::StepToOptimum(double significance) {
  if (sites_in_.empty()) return true;
  Solve(significance);
  const auto n = static_cast<Eigen::Index>(sites_in_.size());
  double step = 1;
  Eigen::Index blocking = -1;
  for (Eigen::Index k = 0; k < n; ++k) {
    if (trial_[k] > 0) continue;
    const double reach = load_[k] > 0 ? load_[k] / (load_[k] - trial_[k]) : 0.0;
    if (reach < step || blocking < 0) {
      step = std::min(step, reach);
      blocking = k;
    }
  }
  load_.head(n) += step * (trial_.head(n) - load_.head(n));
  if (blocking < 0) return true;
  Remove(static_cast<size_t>(blocking));
  return false;
}

void LoadFit::AddToData(const Eigen::VectorXd& by_mm) {
  target_ += by_mm;
  const auto n = static_cast<Eigen::Index>(sites_in_.size());
  rhs_.head(n).noalias() += weighed_.leftCols(n).transpose() * by_mm;
  UpdateResidual();
}

Vec2 LoadFit::tangential_n(size_t k) const {
  const auto n = static_cast<Eigen::Index>(sites_in_.size());
  return load_n(k) / totals_[group_[k]] * solution_.segment<2>(n + 2 * group_[k]);
}

void LoadFit::Optimise(double significance) {
  while (!StepToOptimum(significance)) {
  }
  UpdateResidual();
}

void LoadFit::UpdateResidual() {
  const auto n = static_cast<Eigen::Index>(sites_in_.size());
  residual_ = target_;
  residual_.noalias() -= columns_.leftCols(n) * load_.head(n);
  weighed_is_current_ = false;
}

// Connected loads are one contact.
void LoadFit::FindGroups() {
  group_.assign(sites_in_.size(), -1);
  groups_ = 0;
  for (size_t k = 0; k < sites_in_.size(); ++k) {
    if (group_[k] >= 0) continue;
    group_[k] = groups_;
    for (bool grown = true; grown;) {
      grown = false;
      for (size_t i = 0; i < sites_in_.size(); ++i) {
        for (size_t j = 0; j < sites_in_.size() && group_[i] < 0; ++j) {
          if (group_[j] != groups_ || !sites_.AreNeighbours(sites_in_[i], sites_in_[j])) continue;
          group_[i] = groups_;
          grown = true;
        }
      }
    }
    ++groups_;
  }
}

void LoadFit::SolveSystem(Eigen::Index size, bool with_covariance) {
  auto factor = spread_.topLeftCorner(size, size);
  factor = system_.topLeftCorner(size, size);
  Eigen::Ref<Eigen::MatrixXd> in_place(factor);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(in_place);
  const auto lower = factor.triangularView<Eigen::Lower>();
  auto solution = solution_.head(size);
  solution = system_rhs_.head(size);
  lower.solveInPlace(solution);
  lower.transpose().solveInPlace(solution);
  if (!with_covariance) return;
  auto covariance = covariance_.topLeftCorner(size, size);
  covariance.setIdentity();
  lower.solveInPlace(covariance);
  lower.transpose().solveInPlace(covariance);
}

// All inward loads and two tangential resultants a contact, these with a prior of friction.
Eigen::Index LoadFit::FitTangential(const MarkerData& data) {
  const auto n = static_cast<Eigen::Index>(sites_in_.size());
  const Eigen::Index t = 2 * groups_, all = n + t;
  system_.topLeftCorner(n, n) = gram_.topLeftCorner(n, n);
  system_rhs_.head(n) = rhs_.head(n);
  for (Eigen::Index i = 0; i < t; ++i) {
    data.Weigh(tangential_.col(i), tangential_weighed_.col(i));
    for (Eigen::Index j = 0; j < n; ++j) {
      system_(n + i, j) = system_(j, n + i) = tangential_weighed_.col(i).dot(columns_.col(j));
    }
    for (Eigen::Index j = 0; j <= i; ++j) {
      system_(n + i, n + j) = system_(n + j, n + i) = tangential_weighed_.col(i).dot(tangential_.col(j));
    }
    const double sigma = options_.friction * totals_[i / 2];
    system_(n + i, n + i) += 1 / (sigma * sigma);
    system_rhs_[n + i] = tangential_weighed_.col(i).dot(target_);
  }
  system_.diagonal().head(n) *= 1 + kRidge;
  SolveSystem(all, true);
  // A tangential force that noise could make is not told; its uncertainty is.
  bool dropped = false;
  for (Eigen::Index i = n; i < all; i += 2) {
    const Vec2 force = solution_.segment<2>(i);
    const Mat2 covariance = covariance_.block<2, 2>(i, i);
    if (force.dot(covariance.inverse() * force) > options_.significance * options_.significance) continue;
    for (Eigen::Index k = i; k < i + 2; ++k) {
      system_.row(k).head(all).setZero();
      system_.col(k).head(all).setZero();
      system_(k, k) = 1;
      system_rhs_[k] = 0;
    }
    dropped = true;
  }
  if (dropped) SolveSystem(all, false);
  const auto solution = solution_.head(all);
  Eigen::Index pulling = -1;
  if (n > 0 && solution.head(n).minCoeff(&pulling) <= 0) return pulling;
  load_.head(n) = solution.head(n);
  UpdateResidual();
  if (t > 0) residual_.noalias() -= tangential_.leftCols(t) * solution_.segment(n, t);
  weighed_is_current_ = false;
  return -1;
}

void LoadFit::Write(const MarkerData& data, NodalForces& forces) {
  const auto n = static_cast<Eigen::Index>(sites_in_.size());
  const Eigen::Index t = 2 * groups_;
  // What is left unexplained beyond the noise is the model's error; it widens the result.
  data.Weigh(residual_, weighed_residual_);
  const double unexplained = residual_.dot(weighed_residual_) / std::max(1, data.numbers);
  forces.residual = std::sqrt(std::max(0.0, unexplained));
  if (n == 0) return;
  if (!solution_.head(n + t).allFinite() || !covariance_.topLeftCorner(n + t, n + t).allFinite()) {
    forces.converged = false;
    return;
  }
  covariance_.topLeftCorner(n + t, n + t) *= std::max(1.0, unexplained);
  for (const int site : sites_in_) {
    for (const auto& [marker, share] : sites_.shares[static_cast<size_t>(site)]) {
      if (share > 1e-9 &&
          std::find(forces.loaded.begin(), forces.loaded.end(), marker) == forces.loaded.end()) {
        forces.loaded.push_back(marker);
      }
    }
  }
  std::sort(forces.loaded.begin(), forces.loaded.end());
  const auto rows = static_cast<Eigen::Index>(3 * forces.loaded.size());
  auto to_markers = to_markers_.topLeftCorner(rows, n + t);  // forces of the loaded markers by the unknowns
  to_markers.setZero();
  for (size_t k = 0; k < sites_in_.size(); ++k) {
    const auto site = static_cast<size_t>(sites_in_[k]);
    const Mat3& frame = sites_.frames[site];
    const double part = load_n(k) / totals_[group_[k]];
    for (const auto& [marker, share] : sites_.shares[site]) {
      if (share <= 1e-9) continue;
      const auto row =
          3 * (std::lower_bound(forces.loaded.begin(), forces.loaded.end(), marker) - forces.loaded.begin());
      to_markers.block<3, 1>(row, static_cast<Eigen::Index>(k)) += share * frame.col(0);
      to_markers.block<3, 2>(row, n + 2 * group_[k]) += share * part * frame.rightCols<2>();
    }
  }
  auto lumped = lumped_.head(rows);
  lumped.noalias() = to_markers * solution_.head(n + t);
  if (forces.loaded_covariance.rows() < rows) {
    forces.loaded_covariance.setZero(rows, rows);
  }
  auto spread = spread_.topLeftCorner(n + t, rows);
  spread.noalias() = covariance_.topLeftCorner(n + t, n + t) * to_markers.transpose();
  forces.loaded_covariance.topLeftCorner(rows, rows).noalias() = to_markers * spread;
  for (size_t i = 0; i < forces.loaded.size(); ++i) {
    const auto m = static_cast<size_t>(forces.loaded[i]);
    const auto row = static_cast<Eigen::Index>(3 * i);
    forces.forces_n[m] = lumped.segment<3>(row);
    forces.sigmas_n[m] = std::sqrt(forces.loaded_covariance.block<3, 3>(row, row).trace());
  }
}

}  // namespace taclink

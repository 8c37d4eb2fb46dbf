#include "sensing/force/linear_estimator.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "sensing/mechanics/linear_shell.h"

namespace taclink {
namespace {

// Displacement of every marker's centre, stacked.
Eigen::VectorXd MarkerDisplacements(const LinkModel& model, const ShellMesh& mesh,
                                    const ShellDisplacement& u) {
  const double offset = model.thickness_mm / 2 - model.markers.center_depth_mm;
  Eigen::VectorXd stacked(3 * model.markers.count());
  for (int m = 0; m < model.markers.count(); ++m) {
    stacked.segment<3>(3 * m) = u.AtOffset(mesh, mesh.NodeOfMarker(model, m), offset);
  }
  return stacked;
}

// W with W^T W = (information^-1 + variance I)^-1; the information may be of rank 2.
Mat3 Factor(const Mat3& information, double variance) {
  constexpr double kLeast = 1e-9;  // 1/mm^2, keeps the factor defined
  const Mat3 more = Mat3::Identity() + variance * information;
  const Mat3 less = more.inverse() * information;
  const Eigen::LLT<Mat3> factor(0.5 * (less + less.transpose()) + kLeast * Mat3::Identity());
  return factor.matrixU();
}

}  // namespace

LinearForceEstimator::LinearForceEstimator(const LinkModel& model, const LinearEstimatorOptions& options)
    : options_(options), markers_(model.markers.count()) {
  const LinearShell shell(model, options.refinement);
  const auto& mesh = shell.mesh();
  compliance_.resize(3 * markers_, markers_);
  for (int m = 0; m < markers_; ++m) {
    const int node = mesh.NodeOfMarker(model, m);
    inward_.push_back(-mesh.normals[static_cast<size_t>(node)]);
    const NodalLoad load{node, inward_.back()};
    compliance_.col(m) = MarkerDisplacements(model, mesh, shell.Solve({&load, 1}));
  }
  per_pressure_ = MarkerDisplacements(model, mesh, shell.PerPressure());
  whitener_.resize(3, 3 * markers_);
  whitened_.resize(3 * markers_, markers_);
  norms_.resize(markers_);
  data_.resize(3 * markers_);
  residual_.resize(3 * markers_);
  correlation_.resize(markers_);
  is_loaded_.resize(static_cast<size_t>(markers_));
  const int most = std::min(options_.max_loads, markers_);
  columns_.resize(3 * markers_, most);
  gram_.resize(most, most);
  load_.resize(most);
  trial_.resize(most);
  rhs_.resize(most);
  loaded_.reserve(static_cast<size_t>(most));
  gram_.setZero();
}

// False: nothing moved, no forces to solve for.
bool LinearForceEstimator::Whiten(const SkinShape& shape, double pressure_mpa) {
  bool moved = false;
  measured_numbers_ = 0;
  const double floor2 = options_.noise_floor_mm * options_.noise_floor_mm;
  for (int m = 0; m < markers_; ++m) {
    const auto i = static_cast<size_t>(m);
    auto block = whitener_.block<3, 3>(0, 3 * m);
    const Vec3 inflation = pressure_mpa * per_pressure_.segment<3>(3 * m);
    const MeasuredDisplacement& measured = shape.measured[i];
    const Vec3 u = measured.displacement_mm - inflation;
    if (shape.sources[i] == MarkerSource::kInferred || !u.allFinite() ||
        !measured.information_per_mm2.allFinite()) {
      block.setZero();
      data_.segment<3>(3 * m).setZero();
      continue;
    }
    measured_numbers_ += shape.sources[i] == MarkerSource::kBoth ? 3 : 2;
    const double model_sigma = options_.model_error * u.norm() + options_.pressure_error * inflation.norm();
    block = Factor(measured.information_per_mm2, floor2 + model_sigma * model_sigma);
    data_.segment<3>(3 * m) = block * u;
    moved = moved || data_.segment<3>(3 * m).norm() > options_.significance;
  }
  return moved;
}

void LinearForceEstimator::WhitenCompliance() {
  for (int m = 0; m < markers_; ++m) {
    whitened_.middleRows<3>(3 * m).noalias() =
        whitener_.block<3, 3>(0, 3 * m) * compliance_.middleRows<3>(3 * m);
  }
  norms_ = whitened_.colwise().norm();
}

int LinearForceEstimator::MostSignificantLoad() const {
  int best = -1;
  // Rounding must not let a load in again that has just left.
  double best_score = options_.significance + 1e-9;
  for (int m = 0; m < markers_; ++m) {
    if (is_loaded_[static_cast<size_t>(m)] || norms_[m] <= 0) continue;
    const double score = correlation_[m] / norms_[m];
    if (score > best_score) {
      best_score = score;
      best = m;
    }
  }
  return best;
}

// Of the loaded columns; gram_ then holds the factor.
void LinearForceEstimator::FactorGram() {
  const auto n = static_cast<Eigen::Index>(loaded_.size());
  for (Eigen::Index k = 0; k < n; ++k) {
    columns_.col(k) = whitened_.col(loaded_[static_cast<size_t>(k)]);
    for (Eigen::Index i = 0; i <= k; ++i) gram_(k, i) = columns_.col(k).dot(columns_.col(i));
  }
  Eigen::Ref<Eigen::MatrixXd> gram = gram_.topLeftCorner(n, n);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> in_place(gram);
}

// The minimum over loaded_ alone, sign free.
void LinearForceEstimator::FitLoaded(double penalty, Eigen::VectorXd& load) {
  const auto n = static_cast<Eigen::Index>(loaded_.size());
  FactorGram();
  rhs_.head(n).noalias() = columns_.leftCols(n).transpose() * data_;
  for (Eigen::Index k = 0; k < n; ++k) rhs_[k] -= penalty * norms_[loaded_[static_cast<size_t>(k)]];
  const auto lower = gram_.topLeftCorner(n, n).triangularView<Eigen::Lower>();
  auto solution = load.head(n);
  solution = rhs_.head(n);
  lower.solveInPlace(solution);
  lower.transpose().solveInPlace(solution);
}

// One step of Lawson and Hanson's inner loop: towards the minimum over loaded_, as far as no load has to
// pull; loads that reach zero leave. True: the minimum was reached.
bool LinearForceEstimator::StepToOptimum() {
  FitLoaded(options_.significance, trial_);
  const auto n = static_cast<Eigen::Index>(loaded_.size());
  double step = 1;
  Eigen::Index blocking = -1;
  for (Eigen::Index k = 0; k < n; ++k) {
    if (trial_[k] > 0) continue;
    const double reach = load_[k] / (load_[k] - trial_[k]);
    if (reach < step || blocking < 0) {
      step = std::min(step, reach);
      blocking = k;
    }
  }
  load_.head(n) += step * (trial_.head(n) - load_.head(n));
  if (blocking < 0) return true;
  is_loaded_[static_cast<size_t>(loaded_[static_cast<size_t>(blocking)])] = 0;
  loaded_.erase(loaded_.begin() + blocking);
  for (Eigen::Index k = blocking; k + 1 < n; ++k) load_[k] = load_[k + 1];
  return loaded_.empty();
}

void LinearForceEstimator::UpdateResidual() {
  residual_ = data_;
  for (size_t k = 0; k < loaded_.size(); ++k) {
    residual_ -= load_[static_cast<Eigen::Index>(k)] * whitened_.col(loaded_[k]);
  }
}

void LinearForceEstimator::FindLoads(NodalForces& forces) {
  // Each pass lets one load in; more passes than this mean that rounding makes it turn in circles.
  const int max_passes = 4 * static_cast<int>(load_.size());
  for (int pass = 0; pass < max_passes; ++pass) {
    correlation_.noalias() = whitened_.transpose() * residual_;
    const int next = MostSignificantLoad();
    if (next < 0) return;
    if (static_cast<int>(loaded_.size()) == load_.size()) break;
    load_[static_cast<Eigen::Index>(loaded_.size())] = 0;
    loaded_.push_back(next);
    is_loaded_[static_cast<size_t>(next)] = 1;
    while (!StepToOptimum()) {
    }
    UpdateResidual();
  }
  forces.converged = false;
}

// Without the penalty, which biases all loads; a load that then would pull goes.
void LinearForceEstimator::RemoveBias() {
  while (!loaded_.empty()) {
    FitLoaded(0, load_);
    Eigen::Index weakest = 0;
    if (load_.head(static_cast<Eigen::Index>(loaded_.size())).minCoeff(&weakest) > 0) break;
    loaded_.erase(loaded_.begin() + weakest);
  }
  UpdateResidual();
}

void LinearForceEstimator::Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) {
  forces.model = ForceModel::kLinear;
  forces.forces_n.assign(static_cast<size_t>(markers_), Vec3::Zero());
  forces.sigmas_n.assign(static_cast<size_t>(markers_), 0.0);
  forces.loaded.clear();
  forces.loaded_covariance.setZero();
  forces.residual = 0;
  forces.converged = true;
  const bool moved = Whiten(shape, pressure_mpa);
  residual_ = data_;
  loaded_.clear();
  std::fill(is_loaded_.begin(), is_loaded_.end(), 0);
  if (moved) {
    WhitenCompliance();
    FindLoads(forces);
    RemoveBias();
  }
  const auto n = static_cast<Eigen::Index>(loaded_.size());
  const double residual2 = residual_.squaredNorm() / std::max(1, measured_numbers_);
  forces.residual = std::sqrt(residual2);
  if (n == 0) return;
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto m = static_cast<size_t>(loaded_[static_cast<size_t>(k)]);
    forces.forces_n[m] = load_[k] * inward_[m];
  }
  forces.loaded = loaded_;
  // What is left unexplained beyond the noise is the model's error; it widens the result.
  if (forces.loaded_covariance.rows() < n) forces.loaded_covariance.setZero(gram_.rows(), gram_.rows());
  auto covariance = forces.loaded_covariance.topLeftCorner(n, n);
  const auto lower = gram_.topLeftCorner(n, n).triangularView<Eigen::Lower>();
  covariance.diagonal().setConstant(std::max(1.0, residual2));
  lower.solveInPlace(covariance);
  lower.transpose().solveInPlace(covariance);
  for (Eigen::Index k = 0; k < n; ++k) {
    forces.sigmas_n[static_cast<size_t>(loaded_[static_cast<size_t>(k)])] = std::sqrt(covariance(k, k));
  }
}

}  // namespace taclink

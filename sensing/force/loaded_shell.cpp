#include "sensing/force/loaded_shell.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/force/skin_tangent.h"

namespace taclink {
namespace {

constexpr double kNever = -1e9;
constexpr double kMaxStepMm = 4;
constexpr size_t kMostIdle = 16;  // 30 kB each at refinement 1

}  // namespace

LoadedShell::LoadedShell(const LinkModel& link, int refinement)
    : model_(link),
      mesh_(MakeShellMesh(link, refinement)),
      shell_(SkinSurface(mesh_), link.material),
      sites_(MakeLoadSites(link, mesh_, LoadSpread::kPatch)),
      hessian_(shell_.Pattern()),
      factor_(hessian_),
      rest_factor_(hessian_),
      rest_coordinate_(kNever) {
  Rest();
}

void LoadedShell::Rest() {
  state_ = shell_.Rest();
  loads_.clear();
  idle_.clear();
  held_.clear();
  in_use_ = nullptr;
}

bool LoadedShell::BeginTouch(const ShellState& inflated, double pressure_mpa, double coordinate) {
  Rest();
  state_ = inflated;
  in_use_ = &rest_factor_;
  constexpr double kAlike = 0.2;  // a tangent at a like pressure does
  if (std::abs(coordinate - rest_coordinate_) < kAlike) return true;
  ++factorisations_;
  const FollowerPressure pressure(model_.thickness_mm, pressure_mpa);
  const ElementLoad* all[] = {&pressure};
  shell_.Hessian(state_, all, gradient_, hessian_);
  const bool definite = rest_factor_.Factorise(hessian_);
  rest_coordinate_ = definite ? coordinate : kNever;
  return definite;
}

double LoadedShell::Unbalance(double pressure_mpa) {
  const FollowerPressure pressure(model_.thickness_mm, pressure_mpa);
  const ElementLoad* all[] = {&pressure};
  shell_.Gradient(state_, all, gradient_);
  SubtractLoads();
  return gradient_.cwiseAbs().maxCoeff();
}

// A skin that is pushed deep is unstable under given forces, though not under a body that holds it: the
// loaded nodes are held by springs, and Solve takes these out again (Woodbury).
bool LoadedShell::MakeTangent(double pressure_mpa) {
  ++factorisations_;
  const FollowerPressure pressure(model_.thickness_mm, pressure_mpa);
  const ElementLoad* all[] = {&pressure};
  shell_.Hessian(state_, all, gradient_, hessian_);
  SubtractLoads();
  held_.clear();
  for (const Load& load : loads_)
    held_.push_back(shell_.Dof(sites_.nodes[static_cast<size_t>(load.site)], 0));
  const double scale = model_.material.youngs_modulus_mpa * model_.thickness_mm;
  double held_by = 0;
  bool definite = false;
  for (const double wanted : {1.0, 8.0, 64.0}) {
    definite = HoldAndFactorise(wanted * scale, held_by);
    if (definite) break;
  }
  for (double shift = 1e-3; !definite; shift *= 8) {
    if (shift > 1) return false;
    for (int i = 0; i < hessian_.cols(); ++i) hessian_.coeffRef(i, i) *= 1 + shift;
    definite = factor_.Factorise(hessian_);
  }
  in_use_ = &factor_;
  idle_.clear();
  if (held_.empty()) return true;
  UndoHolding(held_by);
  for (Load& load : loads_) SolveColumns(load);
  return true;
}

bool LoadedShell::HoldAndFactorise(double stiffness_n_mm, double& held_by) {
  for (const int dof : held_) {
    for (int c = 0; c < 3; ++c) hessian_.coeffRef(dof + c, dof + c) += stiffness_n_mm - held_by;
  }
  held_by = stiffness_n_mm;
  return factor_.Factorise(hessian_);
}

void LoadedShell::UndoHolding(double held_by) {
  const auto n = static_cast<Eigen::Index>(3 * held_.size());
  unit_forces_.setZero(shell_.dof_count(), n);
  for (Eigen::Index k = 0; k < n; ++k) unit_forces_(held_[static_cast<size_t>(k / 3)] + k % 3, k) = 1;
  in_use_->Solve(unit_forces_, held_motions_);
  // Where the skin would be unstable, it is taken as soft instead: the step is then too short, not wrong.
  constexpr double kSoftest = 0.03;  // of the springs
  held_undo_.resize(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    held_undo_.row(k) = -held_motions_.row(held_[static_cast<size_t>(k / 3)] + k % 3);
    held_undo_(k, k) += 1 / held_by;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(0.5 * (held_undo_ + held_undo_.transpose()));
  const Eigen::VectorXd inverse = modes.eigenvalues().cwiseMax(kSoftest / held_by).cwiseInverse();
  held_undo_ = modes.eigenvectors() * inverse.asDiagonal() * modes.eigenvectors().transpose();
}

void LoadedShell::Solve(const Eigen::MatrixXd& by_forces, Eigen::MatrixXd& motions) {
  in_use_->Solve(by_forces, motions);
  if (held_.empty()) return;
  at_held_.resize(held_undo_.rows(), motions.cols());
  for (Eigen::Index k = 0; k < at_held_.rows(); ++k)
    at_held_.row(k) = motions.row(held_[static_cast<size_t>(k / 3)] + k % 3);
  motions.noalias() += held_motions_ * (held_undo_ * at_held_);
}

void LoadedShell::AddForce(int site, int direction, double load_n, Eigen::Ref<Eigen::VectorXd> force) const {
  const auto i = static_cast<size_t>(site);
  for (const auto& [node, share] : sites_.spreads[i]) {
    const int dof = shell_.Dof(node, 0);  // only free nodes are in a spread
    force.segment<3>(dof) += load_n * share * sites_.frames[i].col(direction);
  }
}

void LoadedShell::SubtractLoads() {
  for (const Load& load : loads_) {
    AddForce(load.site, 0, -load.load_n, gradient_);
    for (int i = 0; i < 2; ++i) {
      if (load.sideways_n[i] != 0) AddForce(load.site, i + 1, -load.sideways_n[i], gradient_);
    }
  }
}

void LoadedShell::SolveColumns(Load& load) {
  forces_.setZero(shell_.dof_count(), 3);
  for (int direction = 0; direction < 3; ++direction)
    AddForce(load.site, direction, 1, forces_.col(direction));
  Solve(forces_, load.motions);
  for (size_t d = 0; d < 3; ++d) {
    const auto motion = load.motions.col(static_cast<Eigen::Index>(d));
    MarkerMotions(model_, mesh_, shell_, state_, motion, load.columns[d]);
  }
}

const Eigen::VectorXd& LoadedShell::Settle() {
  out_of_balance_ = -gradient_;
  Solve(out_of_balance_, settle_);
  MarkerMotions(model_, mesh_, shell_, state_, settle_.col(0), settle_columns_);
  return settle_columns_;
}

LoadedShell::Loads::const_iterator LoadedShell::Find(int site) const {
  return std::find_if(loads_.begin(), loads_.end(), [&](const Load& load) { return load.site == site; });
}

LoadedShell::Loads::const_iterator LoadedShell::Add(int site) {
  const auto known =
      std::find_if(idle_.begin(), idle_.end(), [&](const Load& load) { return load.site == site; });
  if (known != idle_.end()) {
    loads_.push_back(std::move(*known));
    idle_.erase(known);
  } else {
    loads_.emplace_back().site = site;
    SolveColumns(loads_.back());
  }
  return loads_.end() - 1;
}

void LoadedShell::RemoveGone() {
  for (size_t i = 0; i < loads_.size();) {
    if (loads_[i].load_n > 0) {
      ++i;
      continue;
    }
    loads_[i].load_n = 0;
    loads_[i].sideways_n.setZero();
    if (idle_.size() == kMostIdle) idle_.erase(idle_.begin());
    idle_.push_back(std::move(loads_[i]));
    loads_.erase(loads_.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

double LoadedShell::Advance(const std::vector<Force>& wanted) {
  step_ = settle_.col(0);
  for (size_t i = 0; i < loads_.size(); ++i) {
    const Vec2 more = wanted[i].sideways_n - loads_[i].sideways_n;
    step_.noalias() += loads_[i].motions * Vec3(wanted[i].inward_n - loads_[i].load_n, more.x(), more.y());
  }
  double longest = 0;
  for (int node = 0; node < shell_.node_count(); ++node) {
    const int dof = shell_.Dof(node, 0);
    if (dof >= 0) longest = std::max(longest, step_.segment<3>(dof).norm());
  }
  const double share = std::min(1.0, kMaxStepMm / std::max(longest, 1e-12));
  shell_.Step(share * step_, state_);
  for (size_t i = 0; i < loads_.size(); ++i) {
    loads_[i].load_n += share * (wanted[i].inward_n - loads_[i].load_n);
    loads_[i].sideways_n += share * (wanted[i].sideways_n - loads_[i].sideways_n);
  }
  RemoveGone();
  return longest;
}

}  // namespace taclink

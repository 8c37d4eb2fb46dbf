#include "sensing/force/nonlinear_estimator.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "sensing/force/compliance_estimator.h"
#include "sensing/force/load_fit.h"
#include "sensing/force/load_sites.h"
#include "sensing/force/skin_tangent.h"
#include "sensing/mechanics/nonlinear_shell.h"
#include "sensing/mechanics/sparse_cholesky.h"

namespace taclink {
namespace {

constexpr int kDefaultRefinement = 1;
// In one frame, which bounds its time; the next frame goes on from there.
constexpr int kMostIterations = 6, kMostTangents = 1;
constexpr int kMostUnsettled = 8;         // such frames in a row
constexpr int kNewLoadsPerIteration = 3;  // the linearisation is only good near the state
constexpr size_t kMostIdle = 16;          // 30 kB each at refinement 1
constexpr double kMaxStepMm = 4;
constexpr double kSettledMm = 0.02;       // of a step: a fifth of the markers' noise
constexpr double kNearlySettledMm = 0.5;  // where a frame's iterations end
constexpr double kSlow = 0.5;             // of the steps' decrease: time for a new tangent

}  // namespace

struct NonlinearEstimator::Solver {
  Solver(const LinkModel& link, const ForceOptions& options, std::shared_ptr<PressurisedTangents> shared)
      : model(link),
        mesh(MakeShellMesh(link, options.refinement)),
        shell(SkinSurface(mesh), link.material),
        sites(MakeLoadSites(link, mesh, LoadSpread::kPatch)),
        fit_options(FitOptions(options, sites.count())),
        tangents(std::move(shared)),
        data(link.markers.count(), options.noise_floor_mm),
        fit(sites, link.markers.count(), fit_options),
        hessian(shell.Pattern()),
        factor(hessian),
        rest_factor(hessian),
        predicted(3 * link.markers.count()),
        model_sigma(link.markers.count()) {
    tangents->At(0);
    Rest();
  }

  struct Load {
    int site = 0;
    double load_n = 0;               // inwards
    Vec2 sideways_n = Vec2::Zero();  // around and along the axis
    // Per N inwards, around and along the axis.
    Eigen::MatrixXd motions;                 // of the shell, by degree of freedom
    std::array<Eigen::VectorXd, 3> columns;  // of the markers
  };

  void Rest();
  bool BeginTouch(double pressure_mpa);
  bool Refactor();
  void SolveColumns(Load& load);
  void Solve(const Eigen::MatrixXd& by_forces, Eigen::MatrixXd& motions);
  std::vector<Load>::iterator FindLoad(int site) {
    return std::find_if(loads.begin(), loads.end(), [&](const Load& load) { return load.site == site; });
  }
  void AddForce(int site, int direction, double load_n, Eigen::Ref<Eigen::VectorXd> force) const;
  std::vector<Load>::iterator AddLoad(int site);
  void RemoveGone();
  void SubtractLoads();
  double Unbalance(const ElementLoad& pressure);
  void SetData(const SkinShape& shape, const SkinTangent& tangent, double pressure_mpa);
  bool FindLoads(const SkinTangent& tangent);
  void AddTangential();
  double Advance();
  enum class Outcome { kSettled, kUnderWay, kNoEquilibrium };
  Outcome Iterate(const SkinShape& shape, const SkinTangent& tangent, double pressure_mpa);

  LinkModel model;
  ShellMesh mesh;
  NonlinearShell shell;
  LoadSites sites;
  LoadFitOptions fit_options;
  std::shared_ptr<PressurisedTangents> tangents;  // of point loads: good enough to find candidates
  MarkerData data;
  LoadFit fit;
  Eigen::SparseMatrix<double> hessian;
  SparseCholesky factor;
  SparseCholesky rest_factor;  // of the skin that nothing touches, at the pressure of rest_coordinate
  static constexpr double kNever = -1e9;
  double rest_coordinate = kNever;
  SparseCholesky* in_use = nullptr;
  int unsettled = 0;         // frames in a row
  double shrinkage = kSlow;  // of one step to the next, seen with this tangent
  // Springs that hold the loaded nodes in the factorised matrix, and what undoes them in a solution.
  std::vector<int> held;                 // first degrees of freedom of those nodes
  Eigen::MatrixXd unit_forces, at_held;  // scratch
  Eigen::MatrixXd held_motions;          // of the shell, by a force on each of their directions
  Eigen::MatrixXd held_undo;             // (1 / stiffness - compliance of the held)^-1

  ShellState state;         // in equilibrium with `loads`, nearly
  std::vector<Load> loads;  // those that act on it
  std::vector<Load> idle;   // acted since the last tangent: markers' noise calls them again and again
  Eigen::MatrixXd out_of_balance, settle, forces;
  Eigen::VectorXd gradient, settle_column, step, sum;
  Eigen::VectorXd predicted, model_sigma;
  NonlinearEstimator::Work work;
};

void NonlinearEstimator::Solver::Rest() {
  state = shell.Rest();
  loads.clear();
  idle.clear();
  held.clear();
  in_use = nullptr;
  unsettled = 0;
}

// At the inflated skin, whose factor is kept: a touch begins without a new one.
bool NonlinearEstimator::Solver::BeginTouch(double pressure_mpa) {
  Rest();
  state = tangents->Inflated();
  shrinkage = kSlow;
  in_use = &rest_factor;
  constexpr double kAlike = 0.2;  // a tangent at a like pressure does
  const double at = tangents->Coordinate(pressure_mpa);
  if (std::abs(at - rest_coordinate) < kAlike) return true;
  ++work.factorisations;
  const FollowerPressure pressure(model.thickness_mm, pressure_mpa);
  const ElementLoad* all[] = {&pressure};
  shell.Hessian(state, all, gradient, hessian);
  const bool definite = rest_factor.Factorise(hessian);
  rest_coordinate = definite ? at : kNever;
  return definite;
}

// The tangent at the state. A skin that is pushed deep is unstable under given forces, though not under a
// body that holds it: the loaded nodes are held by springs, and Solve takes these out again (Woodbury).
bool NonlinearEstimator::Solver::Refactor() {
  ++work.factorisations;
  const double scale = model.material.youngs_modulus_mpa * model.thickness_mm;
  held.clear();
  for (const Load& load : loads) held.push_back(shell.Dof(sites.nodes[static_cast<size_t>(load.site)], 0));
  double stiffness = 0;
  bool definite = false;
  for (const double wanted : {1.0, 8.0, 64.0}) {
    for (const int dof : held) {
      for (int c = 0; c < 3; ++c) hessian.coeffRef(dof + c, dof + c) += (wanted - stiffness) * scale;
    }
    stiffness = wanted;
    definite = factor.Factorise(hessian);
    if (definite) break;
  }
  for (double shift = 1e-3; !definite; shift *= 8) {
    if (shift > 1) return false;
    for (int i = 0; i < hessian.cols(); ++i) hessian.coeffRef(i, i) *= 1 + shift;
    definite = factor.Factorise(hessian);
  }
  in_use = &factor;
  idle.clear();
  shrinkage = kSlow;
  if (held.empty()) return true;
  const auto n = static_cast<Eigen::Index>(3 * held.size());
  unit_forces.setZero(shell.dof_count(), n);
  for (Eigen::Index k = 0; k < n; ++k) unit_forces(held[static_cast<size_t>(k / 3)] + k % 3, k) = 1;
  in_use->Solve(unit_forces, held_motions);
  // Where the skin would be unstable, it is taken as soft instead: the step is then too short, not wrong.
  constexpr double kSoftest = 0.03;  // of the springs
  held_undo.resize(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    held_undo.row(k) = -held_motions.row(held[static_cast<size_t>(k / 3)] + k % 3);
    held_undo(k, k) += 1 / (stiffness * scale);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(0.5 * (held_undo + held_undo.transpose()));
  const Eigen::VectorXd inverse = modes.eigenvalues().cwiseMax(kSoftest / (stiffness * scale)).cwiseInverse();
  held_undo = modes.eigenvectors() * inverse.asDiagonal() * modes.eigenvectors().transpose();
  for (Load& load : loads) SolveColumns(load);
  return true;
}

void NonlinearEstimator::Solver::Solve(const Eigen::MatrixXd& by_forces, Eigen::MatrixXd& motions) {
  in_use->Solve(by_forces, motions);
  if (held.empty()) return;
  at_held.resize(held_undo.rows(), motions.cols());
  for (Eigen::Index k = 0; k < at_held.rows(); ++k)
    at_held.row(k) = motions.row(held[static_cast<size_t>(k / 3)] + k % 3);
  motions.noalias() += held_motions * (held_undo * at_held);
}

void NonlinearEstimator::Solver::AddForce(int site, int direction, double load_n,
                                          Eigen::Ref<Eigen::VectorXd> to) const {
  const auto i = static_cast<size_t>(site);
  for (const auto& [node, share] : sites.spreads[i]) {
    const int dof = shell.Dof(node, 0);  // only free nodes are in a spread
    to.segment<3>(dof) += load_n * share * sites.frames[i].col(direction);
  }
}

// All directions at once take little longer than one.
void NonlinearEstimator::Solver::SolveColumns(Load& load) {
  forces.setZero(shell.dof_count(), 3);
  for (int direction = 0; direction < 3; ++direction)
    AddForce(load.site, direction, 1, forces.col(direction));
  Solve(forces, load.motions);
  for (size_t d = 0; d < 3; ++d) {
    MarkerMotions(model, mesh, shell, state, load.motions.col(static_cast<Eigen::Index>(d)), load.columns[d]);
  }
}

// Of all loads, from the gradient.
void NonlinearEstimator::Solver::SubtractLoads() {
  for (const Load& load : loads) {
    AddForce(load.site, 0, -load.load_n, gradient);
    for (int i = 0; i < 2; ++i) {
      if (load.sideways_n[i] != 0) AddForce(load.site, i + 1, -load.sideways_n[i], gradient);
    }
  }
}

// Residual of the shell under pressure and loads, into `gradient`; its largest entry.
double NonlinearEstimator::Solver::Unbalance(const ElementLoad& pressure) {
  const ElementLoad* all[] = {&pressure};
  shell.Gradient(state, all, gradient);
  SubtractLoads();
  return gradient.cwiseAbs().maxCoeff();
}

void NonlinearEstimator::Solver::SetData(const SkinShape& shape, const SkinTangent& tangent,
                                         double pressure_mpa) {
  constexpr double kModelError = 0.03, kPressureError = 0.01;
  for (Eigen::Index m = 0; m < model_sigma.size(); ++m) {
    const Vec3 inflation = tangent.offset_mm.segment<3>(3 * m) +
                           (pressure_mpa - tangent.pressure_mpa) * tangent.per_pressure.segment<3>(3 * m);
    const Vec3 by_loads = shape.measured[static_cast<size_t>(m)].displacement_mm - inflation;
    model_sigma[m] = kModelError * by_loads.norm() + kPressureError * inflation.norm();
  }
  MarkerDisplacements(model, mesh, state, predicted);
  data.Set(shape, predicted, model_sigma);
}

std::vector<NonlinearEstimator::Solver::Load>::iterator NonlinearEstimator::Solver::AddLoad(int site) {
  const auto known =
      std::find_if(idle.begin(), idle.end(), [&](const Load& load) { return load.site == site; });
  if (known != idle.end()) {
    loads.push_back(std::move(*known));
    idle.erase(known);
  } else {
    loads.emplace_back().site = site;
    SolveColumns(loads.back());
  }
  return loads.end() - 1;
}

void NonlinearEstimator::Solver::RemoveGone() {
  for (size_t i = 0; i < loads.size();) {
    if (loads[i].load_n > 0) {
      ++i;
      continue;
    }
    loads[i].load_n = 0;
    loads[i].sideways_n.setZero();
    if (idle.size() == kMostIdle) idle.erase(idle.begin());
    idle.push_back(std::move(loads[i]));
    loads.erase(loads.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

// What the loads have to be for the linearised shell; the fit then holds them. False: too many.
bool NonlinearEstimator::Solver::FindLoads(const SkinTangent& tangent) {
  if (static_cast<int>(loads.size()) > fit_options.max_loads) return false;
  out_of_balance = -gradient;
  Solve(out_of_balance, settle);
  MarkerMotions(model, mesh, shell, state, settle.col(0), settle_column);
  data.residual_mm -= settle_column;
  for (const Load& load : loads) data.residual_mm += load.load_n * load.columns[0];
  fit.Begin(data);
  for (const Load& load : loads) fit.Add(data, load.site, load.columns[0], load.load_n);
  fit.Optimise(fit_options.significance);
  for (int added = 0; added < kNewLoadsPerIteration; ++added) {
    const int site = fit.MostSignificant(data, tangent);
    if (site < 0) break;
    if (fit.IsFull()) return false;
    auto load = FindLoad(site);
    if (load == loads.end()) {  // else one that the fit has just let go
      load = AddLoad(site);
    }
    fit.Add(data, site, load->columns[0], 0);
    fit.Optimise(fit_options.significance);
  }
  fit.RemoveBias();
  AddTangential();
  return true;
}

// What acts sideways was held while sites were sought; now it is sought itself.
void NonlinearEstimator::Solver::AddTangential() {
  sum.setZero(predicted.size());
  for (Load& load : loads) {
    if (load.sideways_n.isZero()) continue;
    sum += load.sideways_n.x() * load.columns[1] + load.sideways_n.y() * load.columns[2];
  }
  fit.AddToData(sum);
  fit.AddTangential(data, [&](const auto& shares, int direction) -> const Eigen::VectorXd& {
    sum.setZero(predicted.size());
    for (Eigen::Index k = 0; k < shares.size(); ++k) {
      if (shares[k] == 0) continue;
      const auto load = FindLoad(fit.sites_in()[static_cast<size_t>(k)]);
      sum += shares[k] * load->columns[static_cast<size_t>(direction) + 1];
    }
    return sum;
  });
}

// Takes the state to the loads of the fit. Returns the longest motion of a node.
double NonlinearEstimator::Solver::Advance() {
  step = settle.col(0);
  struct Force {
    double inward = 0;
    Vec2 sideways = Vec2::Zero();
  };
  std::vector<Force> wanted(loads.size());
  for (size_t k = 0; k < fit.sites_in().size(); ++k) {
    const auto at = FindLoad(fit.sites_in()[k]);
    wanted[static_cast<size_t>(at - loads.begin())] = {fit.load_n(k), fit.tangential_n(k)};
  }
  for (size_t i = 0; i < loads.size(); ++i) {
    const Vec2 more = wanted[i].sideways - loads[i].sideways_n;
    step.noalias() += loads[i].motions * Vec3(wanted[i].inward - loads[i].load_n, more.x(), more.y());
  }
  double longest = 0;
  for (int node = 0; node < shell.node_count(); ++node) {
    const int dof = shell.Dof(node, 0);
    if (dof >= 0) longest = std::max(longest, step.segment<3>(dof).norm());
  }
  const double share = std::min(1.0, kMaxStepMm / std::max(longest, 1e-12));
  shell.Step(share * step, state);
  for (size_t i = 0; i < loads.size(); ++i) {
    loads[i].load_n += share * (wanted[i].inward - loads[i].load_n);
    loads[i].sideways_n += share * (wanted[i].sideways - loads[i].sideways_n);
  }
  RemoveGone();
  return longest;
}

// Gauss-Newton until the state rests. The tangent is kept for as long as its steps shrink.
NonlinearEstimator::Solver::Outcome NonlinearEstimator::Solver::Iterate(const SkinShape& shape,
                                                                        const SkinTangent& tangent,
                                                                        double pressure_mpa) {
  const FollowerPressure pressure(model.thickness_mm, pressure_mpa);
  const ElementLoad* all[] = {&pressure};
  double longest = 0, before = 0;  // of the last two steps
  int made = 0;                    // tangents
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    ++work.iterations;
    if (!std::isfinite(Unbalance(pressure))) return Outcome::kNoEquilibrium;
    const bool slow = iteration > 1 && longest > kSlow * before;
    if (in_use == nullptr || (slow && made < kMostTangents)) {
      ++made;
      shell.Hessian(state, all, gradient, hessian);
      SubtractLoads();
      if (!Refactor()) return Outcome::kNoEquilibrium;
    }
    SetData(shape, tangent, pressure_mpa);
    if (!FindLoads(tangent)) return Outcome::kNoEquilibrium;
    before = longest;
    longest = Advance();
    if (!std::isfinite(longest)) return Outcome::kNoEquilibrium;
    if (iteration > 0) shrinkage = std::max(0.5 * shrinkage, longest / before);
    if (longest < kSettledMm || longest * shrinkage < 0.5 * kSettledMm) return Outcome::kSettled;
  }
  return longest < kNearlySettledMm ? Outcome::kSettled : Outcome::kUnderWay;
}

NonlinearEstimator::NonlinearEstimator(const LinkModel& model, const ForceOptions& options,
                                       std::shared_ptr<PressurisedTangents> tangents) {
  ForceOptions mine = options;
  if (mine.refinement == 0) mine.refinement = kDefaultRefinement;
  if (!tangents) {
    const LoadSites sites = MakeLoadSites(model, MakeShellMesh(model, mine.refinement));
    tangents = std::make_shared<PressurisedTangents>(model, mine.refinement, sites);
  }
  solver_ = std::make_unique<Solver>(model, mine, tangents);
  fallback_ = std::make_unique<ComplianceEstimator>(model, ForceModel::kPressurised, mine, tangents);
}
NonlinearEstimator::~NonlinearEstimator() = default;

void NonlinearEstimator::Restart() {
  solver_->Rest();
}

const NonlinearEstimator::Work& NonlinearEstimator::work() const {
  return solver_->work;
}

void NonlinearEstimator::Estimate(const SkinShape& shape, double pressure_mpa, NodalForces& forces) {
  Solver& s = *solver_;
  ++s.work.frames;
  ClearForces(s.model.markers.count(), ForceModel::kNonlinear, forces);
  const SkinTangent* tangent = s.tangents->At(pressure_mpa);
  if (tangent == nullptr) {
    forces.converged = false;
    return;
  }
  if (s.loads.empty()) {
    // Nothing acts: the skin is where the pressure has it.
    s.predicted = tangent->offset_mm + (pressure_mpa - tangent->pressure_mpa) * tangent->per_pressure;
    s.model_sigma.setZero();
    s.data.Set(shape, s.predicted, s.model_sigma);
    s.fit.Begin(s.data);
    if (s.fit.MostSignificant(s.data, *tangent) < 0) return;
    if (!s.BeginTouch(pressure_mpa)) {
      forces.converged = false;
      return;
    }
  }
  const Solver::Outcome outcome = s.Iterate(shape, *tangent, pressure_mpa);
  if (outcome != Solver::Outcome::kSettled) {
    // A hit may be too deep for one frame's iterations: the next ones go on from there, and meanwhile the
    // cheaper model says what it knows.
    if (outcome == Solver::Outcome::kNoEquilibrium || ++s.unsettled > kMostUnsettled) s.Rest();
    fallback_->Restart();
    fallback_->Estimate(shape, pressure_mpa, forces);
    forces.converged = false;
    return;
  }
  s.unsettled = 0;
  s.fit.Write(s.data, forces);
}

}  // namespace taclink

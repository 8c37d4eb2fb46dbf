#include "sensing/force/nonlinear_estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "sensing/force/compliance_estimator.h"
#include "sensing/force/load_fit.h"
#include "sensing/force/load_sites.h"
#include "sensing/force/loaded_shell.h"
#include "sensing/force/skin_tangent.h"

namespace taclink {
namespace {

constexpr int kDefaultRefinement = 1;
// In one frame, which bounds its time; the next frame goes on from there.
constexpr int kMostIterations = 6, kMostTangents = 1;
constexpr int kMostUnsettled = 8;         // such frames in a row
constexpr int kNewLoadsPerIteration = 3;  // the linearisation is only good near the state
constexpr double kSettledMm = 0.02;       // of a step: a fifth of the markers' noise
constexpr double kNearlySettledMm = 0.5;  // where a frame's iterations end
constexpr double kSlow = 0.5;             // of the steps' decrease: time for a new tangent

}  // namespace

struct NonlinearEstimator::Solver {
  Solver(const LinkModel& link, const ForceOptions& options, std::shared_ptr<PressurisedTangents> shared)
      : model(link),
        shell(link, options.refinement),
        fit_options(FitOptions(options, shell.sites().count())),
        tangents(std::move(shared)),
        data(link.markers.count(), options.noise_floor_mm),
        fit(shell.sites(), link.markers.count(), fit_options),
        predicted(3 * link.markers.count()),
        model_sigma(link.markers.count()) {
    tangents->At(0);
  }

  void Rest();
  bool BeginTouch(double pressure_mpa);
  void SetData(const SkinShape& shape, const SkinTangent& tangent, double pressure_mpa);
  bool FindLoads(const SkinTangent& tangent);
  void AddTangential();
  double Advance();
  enum class Outcome { kSettled, kUnderWay, kNoEquilibrium };
  Outcome Iterate(const SkinShape& shape, const SkinTangent& tangent, double pressure_mpa);

  LinkModel model;
  LoadedShell shell;
  LoadFitOptions fit_options;
  std::shared_ptr<PressurisedTangents> tangents;  // of point loads: good enough to find candidates
  MarkerData data;
  LoadFit fit;
  int unsettled = 0;         // frames in a row
  double shrinkage = kSlow;  // of one step to the next, seen with this tangent
  Eigen::VectorXd predicted, model_sigma, sum;
  std::vector<LoadedShell::Force> wanted;
  NonlinearEstimator::Work work;
};

void NonlinearEstimator::Solver::Rest() {
  shell.Rest();
  unsettled = 0;
}

bool NonlinearEstimator::Solver::BeginTouch(double pressure_mpa) {
  shrinkage = kSlow;
  unsettled = 0;
  return shell.BeginTouch(tangents->Inflated(), pressure_mpa, tangents->Coordinate(pressure_mpa));
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
  MarkerDisplacements(model, shell.mesh(), shell.state(), predicted);
  data.Set(shape, predicted, model_sigma);
}

// What the loads have to be for the linearised shell; the fit then holds them. False: too many.
bool NonlinearEstimator::Solver::FindLoads(const SkinTangent& tangent) {
  if (static_cast<int>(shell.loads().size()) > fit_options.max_loads) return false;
  data.residual_mm -= shell.Settle();
  for (const auto& load : shell.loads()) data.residual_mm += load.load_n * load.columns[0];
  fit.Begin(data);
  for (const auto& load : shell.loads()) fit.Add(data, load.site, load.columns[0], load.load_n);
  fit.Optimise(fit_options.significance);
  for (int added = 0; added < kNewLoadsPerIteration; ++added) {
    const int site = fit.MostSignificant(data, tangent);
    if (site < 0) break;
    if (fit.IsFull()) return false;
    auto load = shell.Find(site);
    if (load == shell.loads().end()) load = shell.Add(site);  // else one that the fit has just let go
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
  for (const auto& load : shell.loads()) {
    if (load.sideways_n.isZero()) continue;
    sum += load.sideways_n.x() * load.columns[1] + load.sideways_n.y() * load.columns[2];
  }
  fit.AddToData(sum);
  fit.AddTangential(data, [&](const auto& shares, int direction) -> const Eigen::VectorXd& {
    sum.setZero(predicted.size());
    for (Eigen::Index k = 0; k < shares.size(); ++k) {
      if (shares[k] == 0) continue;
      const auto load = shell.Find(fit.sites_in()[static_cast<size_t>(k)]);
      sum += shares[k] * load->columns[static_cast<size_t>(direction) + 1];
    }
    return sum;
  });
}

// Takes the state to the loads of the fit. Returns the longest motion of a node.
double NonlinearEstimator::Solver::Advance() {
  wanted.assign(shell.loads().size(), {});
  for (size_t k = 0; k < fit.sites_in().size(); ++k) {
    const auto at = shell.Find(fit.sites_in()[k]);
    wanted[static_cast<size_t>(at - shell.loads().begin())] = {fit.load_n(k), fit.tangential_n(k)};
  }
  return shell.Advance(wanted);
}

// Gauss-Newton until the state rests. The tangent is kept for as long as its steps shrink.
NonlinearEstimator::Solver::Outcome NonlinearEstimator::Solver::Iterate(const SkinShape& shape,
                                                                        const SkinTangent& tangent,
                                                                        double pressure_mpa) {
  double longest = 0, before = 0;  // of the last two steps
  int made = 0;                    // tangents
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    ++work.iterations;
    if (!std::isfinite(shell.Unbalance(pressure_mpa))) return Outcome::kNoEquilibrium;
    const bool slow = iteration > 1 && longest > kSlow * before;
    if (!shell.has_tangent() || (slow && made < kMostTangents)) {
      ++made;
      if (!shell.MakeTangent(pressure_mpa)) return Outcome::kNoEquilibrium;
      shrinkage = kSlow;
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
  solver_->work.factorisations = solver_->shell.factorisations();
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
  if (s.shell.loads().empty()) {
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

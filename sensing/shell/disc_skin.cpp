#include "sensing/shell/disc_skin.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "sensing/shell/sparse_cholesky.h"

namespace taclink {
namespace {

constexpr double kTolerance = 5e-8;        // of E t^2, of each entry of the residual
constexpr double kForceTolerance = 5e-5;   // of a disc's force
constexpr double kLeastForceShare = 2e-6;  // of E t^2: what a disc's force need not be nearer to
constexpr double kWorthKeeping = 0.5;      // a kept matrix must shrink the misfit by this each time
constexpr int kMostIterations = 80, kMostFactorizations = 14;
constexpr double kMostStepMm = 4, kMostTurn = 0.5, kMostDepthStepMm = 2;
constexpr double kNearMm = 0.01;  // of a state for which a matrix is as good as that state's own
constexpr int kMostReleases = 4;
constexpr double kRimMm = 0.25;    // radius of a disc's edge
constexpr double kSearchMm = 0.1;  // into the skin, of a disc that does not touch
constexpr double kProbeMm = 1e-4;

double ForceUnit(const LinkModel& model) {
  return model.material.youngs_modulus_mpa * model.thickness_mm * model.thickness_mm;
}

}  // namespace

const char* Name(BalanceStop stop) {
  switch (stop) {
    case BalanceStop::kConverged:
      return "converged";
    case BalanceStop::kMaxIterations:
      return "no convergence";
    case BalanceStop::kNotFinite:
      return "not finite";
    case BalanceStop::kUnstable:
      return "the skin would snap";
  }
  return "unknown";
}

struct DiscSkin::Factor {
  explicit Factor(const Eigen::SparseMatrix<double>& pattern) : llt(pattern), hessian(pattern) {}

  SparseCholesky llt;
  Eigen::SparseMatrix<double> hessian;
  bool good = false;
};

DiscSkin::DiscSkin(const LinkModel& model, size_t disc_count, const PressedSkinOptions& options)
    : model_(model),
      options_(options),
      mesh_(MakeShellMesh(model, options.refinement)),
      shell_(SkinSurface(mesh_), model.material),
      pressure_(0),
      corner_areas_mm2_(CornerAreas(shell_.surface())),
      body_(corner_areas_mm2_, Vec3::Zero()),
      factor_(std::make_unique<Factor>(shell_.Pattern())) {
  const RigidContactOptions contact = {
      .spacing_mm = options.spacing_mm, .stiffness_n_mm3 = WallStiffness({}), .sticks = false};
  const RigidContact of_nothing(shell_, contact);  // its points are those of all
  if (model.tube_outer_radius_mm > 0) {
    tube_ = std::make_unique<RigidContact>(of_nothing);
    tube_->SetBody(RigidBar{Vec3::Zero(), Vec3::UnitZ(), model.tube_outer_radius_mm});
  }
  for (size_t i = 0; i < disc_count; ++i) discs_.emplace_back(of_nothing);
}

DiscSkin::~DiscSkin() = default;

SkinBalance DiscSkin::Rest() const {
  return {shell_.Rest(), std::vector<double>(discs_.size(), 0.0), std::vector<bool>(discs_.size(), false)};
}

SkinBalance DiscSkin::NearTo(std::span<const Vec3> mids_mm, std::span<const Vec3> directors) const {
  SkinBalance balance = Rest();
  for (size_t i = 0; i < mids_mm.size(); ++i) {
    Vec3& d = balance.state.directors[i];
    Vec3& t = balance.state.tangents[i];
    balance.state.mids_mm[i] = mids_mm[i];
    d = directors[i].normalized();
    t = (t - t.dot(d) * d).normalized();
  }
  std::ranges::fill(balance.depth_mm, kOffMm);
  return balance;
}

RigidBody DiscSkin::BodyOf(const SkinDisc& disc, double depth_mm) const {
  const Vec3 foremost = model_.PointAtDepth(disc.angle_rad, disc.z_mm, depth_mm);
  const Vec3 outward = model_.OutwardNormal(disc.angle_rad, disc.z_mm);
  const double radius = std::max(disc.diameter_mm / 2, kRimMm);
  if (disc.is_sphere) return RigidSphere{foremost + radius * outward, radius};
  return RigidStamp{foremost, -outward, radius, kRimMm};
}

// N/mm^3.
double DiscSkin::WallStiffness(const SkinLoad& load) const {
  return load.wall_stiffness *
         (options_.stiffness * model_.material.youngs_modulus_mpa / model_.thickness_mm);
}

void DiscSkin::Apply(const SkinLoad& load, const SkinBalance& balance) {
  pressure_ = FollowerPressure(load.pressure_mpa);
  loads_ = {&pressure_};
  if (!load.specific_force_mps2.isZero(0)) {
    body_ = BodyForce(corner_areas_mm2_, model_.MassPerArea() * load.specific_force_mps2);
    loads_.push_back(&body_);
  }
  const double stiffness_n_mm3 = WallStiffness(load);
  if (tube_) {
    tube_->SetStiffness(stiffness_n_mm3);
    loads_.push_back(tube_.get());
  }
  searched_.clear();
  for (size_t i = 0; i < discs_.size(); ++i) {
    const SkinDisc& disc = load.discs[i];
    if (!disc.on) continue;
    const bool searched = disc.force_n && !balance.limited[i];
    discs_[i].SetBody(BodyOf(disc, searched ? balance.depth_mm[i] : disc.depth_mm));
    discs_[i].SetStiffness(stiffness_n_mm3);
    loads_.push_back(&discs_[i]);
    if (searched) searched_.push_back(i);
  }
}

// Sets gradient_ and excess_. Returns the largest of their entries, each by its tolerance.
double DiscSkin::Misfit(const SkinLoad& load, const SkinBalance& balance) {
  Apply(load, balance);
  shell_.Gradient(balance.state, loads_, gradient_);
  if (load.dead_n.size() > 0) gradient_ -= load.dead_n;
  const double unit = ForceUnit(model_);
  double misfit = gradient_.size() > 0 ? gradient_.cwiseAbs().maxCoeff() / (kTolerance * unit) : 0.0;
  excess_.resize(static_cast<Eigen::Index>(searched_.size()));
  for (size_t k = 0; k < searched_.size(); ++k) {
    const SkinDisc& disc = load.discs[searched_[k]];
    const Vec3 axis = -model_.OutwardNormal(disc.angle_rad, disc.z_mm);
    const double force = discs_[searched_[k]].Summarize(balance.state).force_n.dot(axis);
    excess_[static_cast<Eigen::Index>(k)] = force - *disc.force_n;
    misfit = std::max(misfit, std::abs(force - *disc.force_n) /
                                  std::max(kForceTolerance * *disc.force_n, kLeastForceShare * unit));
  }
  return misfit;
}

bool DiscSkin::Factorize(const SkinLoad& load, const ShellState& state) {
  ++factorizations_;
  shell_.Hessian(state, loads_, gradient_, factor_->hessian);
  if (load.dead_n.size() > 0) gradient_ -= load.dead_n;
  factor_->good = factor_->llt.Factorise(factor_->hessian);
  return factor_->good;
}

// The energy's gradient, differentiated by a disc's depth. Only mid-surface points carry contact.
Eigen::VectorXd DiscSkin::DepthGradient(size_t disc, const SkinDisc& place, double depth_mm,
                                        const ShellState& state) {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(shell_.dof_count());
  const auto& elements = shell_.surface().elements;
  for (const double side : {1.0, -1.0}) {
    discs_[disc].SetBody(BodyOf(place, depth_mm + side * kProbeMm));
    for (size_t e = 0; e < elements.size(); ++e) {
      ElementResponse response;
      discs_[disc].Add(DerivativeOrder::kGradient, static_cast<int>(e),
                       shell_.StateOf(static_cast<int>(e), state), response);
      if (response.energy_nmm == 0) continue;
      for (size_t corner = 0; corner < 4; ++corner) {
        for (int c = 0; c < 3; ++c) {
          const int dof = shell_.Dof(elements[e][corner], c);
          if (dof >= 0)
            change[dof] +=
                side / (2 * kProbeMm) * response.gradient[static_cast<Eigen::Index>(6 * corner) + c];
        }
      }
    }
  }
  discs_[disc].SetBody(BodyOf(place, depth_mm));
  return change;
}

// What the searched discs' depths do to the skin, with the matrix at hand: a disc's force is the energy's
// derivative by its depth, hence one matrix serves both. A disc is about as stiff as the skin under it; their
// difference counts, so that both must be of the state that the matrix is of.
void DiscSkin::LearnDepths(const SkinLoad& load, const SkinBalance& balance) {
  const auto n = static_cast<Eigen::Index>(searched_.size());
  learnt_with_ = factorizations_;
  by_depth_.resize(shell_.dof_count(), n);
  stiffness_.setZero(n, n);
  answer_.resize(shell_.dof_count(), n);
  if (n == 0) return;
  for (Eigen::Index k = 0; k < n; ++k) {
    const size_t i = searched_[static_cast<size_t>(k)];
    by_depth_.col(k) = DepthGradient(i, load.discs[i], balance.depth_mm[i], balance.state);
    stiffness_(k, k) = discs_[i].Summarize(balance.state).area_mm2 * options_.stiffness *
                       model_.material.youngs_modulus_mpa / model_.thickness_mm * load.wall_stiffness;
  }
  factor_->llt.Solve(by_depth_, answer_);
  for (Eigen::Index k = 0; k < n; ++k) {
    if (stiffness_(k, k) > 0) continue;
    stiffness_(k, k) = -excess_[k] / kSearchMm;  // does not touch: a step of that size towards the skin
    if (!(stiffness_(k, k) > 0)) stiffness_(k, k) = 1;
  }
  stiffness_ -= by_depth_.transpose() * answer_;
}

// Sets step_ and depth_step_ to what answers these forces on the skin and on the searched discs.
void DiscSkin::Solve(const Eigen::VectorXd& forces, const Eigen::VectorXd& disc_forces) {
  factor_->llt.Solve(forces, step_);
  depth_step_.resize(disc_forces.size());
  if (disc_forces.size() == 0) return;
  depth_step_ = stiffness_.partialPivLu().solve(disc_forces - by_depth_.transpose() * step_);
  step_ -= answer_ * depth_step_;
}

// Broyden's update [broyden1965], from the steps taken with this matrix [kelley2003, chapter 4]: the matrix
// of another state serves longer.
void DiscSkin::Improve() {
  Eigen::VectorXd z(step_.size() + depth_step_.size());
  z << step_, depth_step_;
  for (size_t j = 0; j + 1 < taken_.size(); ++j)
    z += taken_[j + 1] * (taken_[j].dot(z) / taken_[j].squaredNorm());
  if (!taken_.empty()) z /= 1 - taken_.back().dot(z) / taken_.back().squaredNorm();
  step_ = z.head(step_.size());
  depth_step_ = z.tail(depth_step_.size());
  taken_.push_back(std::move(z));
}

// Share of the step that keeps every motion in bounds.
double DiscSkin::StepLimit() const {
  double share = 1;
  for (int node = 0; node < shell_.node_count(); ++node) {
    for (int c = 0; c < 5; ++c) {
      const int dof = shell_.Dof(node, c);
      if (dof < 0) continue;
      const double limit = c < 3 ? kMostStepMm : kMostTurn;
      share = std::min(share, limit / std::max(std::abs(step_[dof]), limit));
    }
  }
  for (const double step : depth_step_)
    share = std::min(share, kMostDepthStepMm / std::max(std::abs(step), kMostDepthStepMm));
  return share;
}

void DiscSkin::Advance(const SkinLoad& load, double share, SkinBalance& balance) {
  shell_.Step(share * step_, balance.state);
  for (size_t k = 0; k < searched_.size(); ++k) {
    const size_t i = searched_[k];
    double& depth = balance.depth_mm[i];
    depth += share * depth_step_[static_cast<Eigen::Index>(k)];
    if (depth < load.discs[i].depth_mm) continue;
    depth = load.discs[i].depth_mm;
    balance.limited[i] = true;
  }
}

// True: a disc at its most depth now has more force than is asked, and may come back.
bool DiscSkin::ReleaseLimits(const SkinLoad& load, SkinBalance& balance) const {
  bool released = false;
  for (size_t i = 0; i < discs_.size(); ++i) {
    const SkinDisc& disc = load.discs[i];
    if (!disc.on || !disc.force_n || !balance.limited[i]) continue;
    const Vec3 axis = -model_.OutwardNormal(disc.angle_rad, disc.z_mm);
    if (discs_[i].Summarize(balance.state).force_n.dot(axis) <= *disc.force_n) continue;
    balance.limited[i] = false;
    balance.depth_mm[i] = disc.depth_mm;
    released = true;
  }
  return released;
}

BalanceSummary DiscSkin::Balance(const SkinLoad& load, SkinBalance& balance) {
  BalanceSummary summary;
  const int before = factorizations_;
  const auto ended = [&](BalanceStop stop) {
    summary.stop = stop;
    summary.factorizations = factorizations_ - before;
    return summary;
  };
  int releases = 0;
  double last = 0;        // misfit
  double moved_mm = 1e9;  // since the matrix was made
  SkinBalance last_good;  // to which a step with an old matrix may go back
  bool fresh = false;     // it was made for the last step
  std::vector<size_t> searched;
  for (;; ++summary.iterations) {
    double misfit = Misfit(load, balance);
    summary.residual_n = gradient_.size() > 0 ? gradient_.cwiseAbs().maxCoeff() : 0.0;
    if (!std::isfinite(misfit)) return ended(BalanceStop::kNotFinite);
    if (misfit <= 1) {
      if (!ReleaseLimits(load, balance) || ++releases >= kMostReleases) break;
      last = 0;
      continue;
    }
    if (summary.iterations >= kMostIterations || factorizations_ - before >= kMostFactorizations)
      return ended(BalanceStop::kMaxIterations);
    // Also at first: last is 0.
    const bool slow = misfit > kWorthKeeping * last || searched != searched_;
    if (last > 0 && misfit > last && !fresh) {
      balance = last_good;
      misfit = Misfit(load, balance);
    }
    if (slow) {
      if (!Factorize(load, balance.state)) return ended(BalanceStop::kUnstable);
      moved_mm = 0;
      LearnDepths(load, balance);
      taken_.clear();
    }
    searched = searched_;
    fresh = slow;
    last = misfit;
    last_good = balance;
    Solve(-gradient_, -excess_);
    Improve();
    const double share = StepLimit();
    if (share < 1) taken_.clear();
    Advance(load, share, balance);
    moved_mm += share * step_.cwiseAbs().maxCoeff();
  }
  for (size_t i = 0; i < discs_.size(); ++i) {
    if (load.discs[i].on && (!load.discs[i].force_n || balance.limited[i]))
      balance.depth_mm[i] = load.discs[i].depth_mm;
  }
  const bool stable = moved_mm < kNearMm || Factorize(load, balance.state);
  return ended(stable ? BalanceStop::kConverged : BalanceStop::kUnstable);
}

SkinRates DiscSkin::RatesAt(const SkinLoad& before, const SkinLoad& after, double span,
                            const SkinBalance& balance) {
  Misfit(before, balance);
  const Eigen::VectorXd gradient = gradient_, excess = excess_;
  Misfit(after, balance);
  const Eigen::VectorXd forces = (gradient - gradient_) / span, disc_forces = (excess - excess_) / span;
  if (learnt_with_ != factorizations_ || answer_.cols() != disc_forces.size()) LearnDepths(after, balance);
  Solve(forces, disc_forces);
  SkinRates rates;
  for (size_t node = 0; node < balance.state.mids_mm.size(); ++node) {
    const auto value = [&](int c) {
      const int dof = shell_.Dof(static_cast<int>(node), c);
      return dof >= 0 ? step_[dof] : 0.0;
    };
    const Vec3& d = balance.state.directors[node];
    const Vec3& t = balance.state.tangents[node];
    const Vec3 turn = value(3) * t + value(4) * d.cross(t);
    rates.mids_mm.emplace_back(value(0), value(1), value(2));
    rates.directors.emplace_back(turn.cross(d));
  }
  for (size_t i = 0; i < discs_.size(); ++i)
    rates.depth_mm.push_back((after.discs[i].depth_mm - before.discs[i].depth_mm) / span);
  for (size_t k = 0; k < searched_.size(); ++k)
    rates.depth_mm[searched_[k]] = depth_step_[static_cast<Eigen::Index>(k)];
  return rates;
}

std::vector<RigidContact::Summary> DiscSkin::Contacts(const SkinLoad& load, const SkinBalance& balance) {
  Apply(load, balance);
  std::vector<RigidContact::Summary> contacts(discs_.size());
  for (size_t i = 0; i < discs_.size(); ++i) {
    if (load.discs[i].on) contacts[i] = discs_[i].Summarize(balance.state);
  }
  return contacts;
}

const Eigen::VectorXd& DiscSkin::Residual(const SkinLoad& load, const SkinBalance& balance) {
  Misfit(load, balance);
  return gradient_;
}

Eigen::VectorXd DiscSkin::InternalForces(const ShellState& state) const {
  Eigen::VectorXd forces;
  shell_.Gradient(state, {}, forces);
  return forces;
}

}  // namespace taclink

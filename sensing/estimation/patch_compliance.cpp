#include "sensing/estimation/patch_compliance.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <utility>

namespace taclink {
namespace {

constexpr double kTurnMm = 10;  // of a director, a radian

using Hessian = Eigen::Matrix<double, NonlinearShell::kElementDofs, NonlinearShell::kElementDofs>;

// Translations of the corners to cylindrical coordinates; `turns`: cosine and sine of the corners' angles.
void Turn(const std::array<Vec2, 4>& turns, Hessian& hessian) {
  for (Eigen::Index i = 0; i < 4; ++i) {
    const Vec2& by = turns[static_cast<size_t>(i)];
    Mat2 turn;
    turn << by.x(), by.y(), -by.y(), by.x();
    hessian.middleRows<2>(kNodeDofs * i) = (turn * hessian.middleRows<2>(kNodeDofs * i)).eval();
    hessian.middleCols<2>(kNodeDofs * i) = (hessian.middleCols<2>(kNodeDofs * i) * turn.transpose()).eval();
  }
}

}  // namespace

StatePatch PatchBetween(const SkinMechanics& mechanics, const ShellState& from, const ShellState& to,
                        size_t most_sites) {
  const double turn_mm = kTurnMm * mechanics.length_unit();
  std::vector<std::pair<double, int>> changes;  // squared
  for (int site = 0; site < mechanics.site_count(); ++site) {
    const auto node = static_cast<size_t>(mechanics.NodeOfSite(site));
    changes.emplace_back((to.mids_mm[node] - from.mids_mm[node]).squaredNorm() +
                             turn_mm * turn_mm * (to.directors[node] - from.directors[node]).squaredNorm(),
                         site);
  }
  most_sites = std::min(most_sites, changes.size() - 1);
  const auto outside = changes.begin() + static_cast<std::ptrdiff_t>(most_sites);
  std::ranges::nth_element(changes, outside, std::greater());
  StatePatch patch{.sites = {}, .outside_mm = std::sqrt(outside->first)};
  std::transform(changes.begin(), outside, std::back_inserter(patch.sites),
                 [](const auto& change) { return change.second; });
  std::ranges::sort(patch.sites);
  return patch;
}

PatchCompliance::PatchCompliance(const SkinMechanics& mechanics)
    : mechanics_(mechanics), jacobian_(mechanics.markers().MakeJacobian(mechanics.shell())) {
  touched_jacobian_ = jacobian_;
}

// Cosine and sine of a node's angle at rest.
Vec2 PatchCompliance::TurnOf(int node) const {
  return mechanics_.mesh().mid_mm[static_cast<size_t>(node)].head<2>().normalized();
}

// A clamped node counts as one of the patch.
bool PatchCompliance::Has(int node) const {
  const int site = node - mechanics_.columns();
  return site < 0 || site >= mechanics_.site_count() || place_[static_cast<size_t>(site)] >= 0;
}

bool PatchCompliance::Set(std::shared_ptr<const RoundCompliance> round, const ShellState& state,
                          double pressure_mpa, std::vector<int> sites) {
  round_ = std::move(round);
  sites_ = std::move(sites);
  place_.assign(static_cast<size_t>(mechanics_.site_count()), -1);
  for (size_t i = 0; i < sites_.size(); ++i) place_[static_cast<size_t>(sites_[i])] = static_cast<int>(i);
  WriteChange(state, pressure_mpa);
  WriteJacobian(state);
  WriteCompliance();
  responses_.resize(0, 0);
  RowMajor sum = change_ * RowMajor(compliance_);
  sum.diagonal().array() += 1;
  return factor_.Set(sum);
}

void PatchCompliance::WriteChange(const ShellState& state, double pressure_mpa) {
  const NonlinearShell& shell = mechanics_.shell();
  const int around = mechanics_.columns();
  const PressureLoads pressure(pressure_mpa), inflating(round_->skin().pressure_mpa);
  std::vector<std::optional<Hessian>> inflated(static_cast<size_t>(mechanics_.mesh().rows));  // by ring
  NonlinearShell::ElementPart part;
  std::vector<Eigen::Triplet<float>> entries;
  for (int element = 0; element < static_cast<int>(shell.surface().elements.size()); ++element) {
    const std::array<int, 4>& nodes = shell.surface().elements[static_cast<size_t>(element)];
    if (!std::ranges::all_of(nodes, [&](int node) { return Has(node); })) continue;
    const auto ring = static_cast<size_t>(element / around);
    std::array<Vec2, 4> turns;
    if (!inflated[ring]) {
      const int first = element - element % around;
      const std::array<int, 4>& of_first = shell.surface().elements[static_cast<size_t>(first)];
      std::ranges::transform(of_first, turns.begin(), [&](int node) { return TurnOf(node); });
      shell.SetElementPart(first, round_->skin().state, inflating.loads(), part);
      inflated[ring] = part.hessian;
      Turn(turns, *inflated[ring]);
    }
    std::ranges::transform(nodes, turns.begin(), [&](int node) { return TurnOf(node); });
    shell.SetElementPart(element, state, pressure.loads(), part);
    Turn(turns, part.hessian);
    part.hessian -= *inflated[ring];
    for (Eigen::Index i = 0; i < 4; ++i) {
      for (Eigen::Index j = 0; j < 4; ++j) {
        const int site = nodes[static_cast<size_t>(i)] - around,
                  other = nodes[static_cast<size_t>(j)] - around;
        const auto is_free = [&](int each) { return each >= 0 && each < mechanics_.site_count(); };
        if (!is_free(site) || !is_free(other)) continue;
        const int at = kNodeDofs * place_[static_cast<size_t>(site)],
                  beside = kNodeDofs * place_[static_cast<size_t>(other)];
        for (int r = 0; r < kNodeDofs; ++r) {
          for (int c = 0; c < kNodeDofs; ++c)
            entries.emplace_back(at + r, beside + c,
                                 static_cast<float>(part.hessian(kNodeDofs * i + r, kNodeDofs * j + c)));
        }
      }
    }
  }
  const auto size = kNodeDofs * static_cast<Eigen::Index>(sites_.size());
  change_.resize(size, size);
  change_.setFromTriplets(entries.begin(), entries.end());
}

// Of a marker whose surroundings are all in the patch, that of the touched skin.
void PatchCompliance::WriteJacobian(const ShellState& state) {
  const MarkerMap& map = mechanics_.markers();
  map.WriteJacobian(mechanics_.shell(), state, touched_jacobian_);
  jacobian_ = round_->jacobian();
  touched_rows_.clear();
  for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
    const int first = jacobian_.outerIndexPtr()[row], end = jacobian_.outerIndexPtr()[row + 1];
    const int* inner = jacobian_.innerIndexPtr();
    if (std::any_of(inner + first, inner + end,
                    [&](int dof) { return place_[static_cast<size_t>(dof / kNodeDofs)] < 0; }))
      continue;
    std::copy(touched_jacobian_.valuePtr() + first, touched_jacobian_.valuePtr() + end,
              jacobian_.valuePtr() + first);
    TouchedRow& touched = touched_rows_.emplace_back();
    touched.row = row;
    for (int k = first; k < end; k += 1) {
      const int site = inner[k] / kNodeDofs, component = inner[k] % kNodeDofs,
                at = kNodeDofs * place_[static_cast<size_t>(site)];
      const auto value = static_cast<float>(jacobian_.valuePtr()[k]);
      if (component >= 2) {
        touched.entries.emplace_back(at + component, value);
        continue;
      }
      const Vec2 turn = TurnOf(mechanics_.NodeOfSite(site));
      const Vec2 by = component == 0 ? Vec2(turn.x(), -turn.y()) : Vec2(turn.y(), turn.x());
      touched.entries.emplace_back(at, value * static_cast<float>(by.x()));
      touched.entries.emplace_back(at + 1, value * static_cast<float>(by.y()));
    }
  }
}

void PatchCompliance::WriteCompliance() {
  const auto count = static_cast<Eigen::Index>(sites_.size());
  compliance_.resize(kNodeDofs * count, kNodeDofs * count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j)
      compliance_.block<kNodeDofs, kNodeDofs>(kNodeDofs * i, kNodeDofs * j) =
          round_->BlockOf(sites_[static_cast<size_t>(i)], sites_[static_cast<size_t>(j)]);
  }
}

// E' x.
void PatchCompliance::Gather(const Eigen::VectorXd& by_dof, Eigen::Ref<Eigen::VectorXf> of_patch) const {
  for (size_t i = 0; i < sites_.size(); ++i) {
    const Vec2 turn = TurnOf(mechanics_.NodeOfSite(sites_[i]));
    const auto from = by_dof.segment<kNodeDofs>(kNodeDofs * sites_[i]);
    auto to = of_patch.segment<kNodeDofs>(kNodeDofs * static_cast<Eigen::Index>(i));
    to = from.cast<float>();
    to[0] = static_cast<float>(turn.x() * from[0] + turn.y() * from[1]);
    to[1] = static_cast<float>(turn.x() * from[1] - turn.y() * from[0]);
  }
}

// by_dof := by_dof - E x.
void PatchCompliance::Subtract(const Eigen::Ref<const Eigen::VectorXf>& of_patch,
                               Eigen::VectorXd& by_dof) const {
  for (size_t i = 0; i < sites_.size(); ++i) {
    const Vec2 turn = TurnOf(mechanics_.NodeOfSite(sites_[i]));
    Eigen::Matrix<double, kNodeDofs, 1> more =
        of_patch.segment<kNodeDofs>(kNodeDofs * static_cast<Eigen::Index>(i)).cast<double>();
    more.head<2>() = Vec2(turn.x() * more[0] - turn.y() * more[1], turn.y() * more[0] + turn.x() * more[1]);
    by_dof.segment<kNodeDofs>(kNodeDofs * sites_[i]) -= more;
  }
}

void PatchCompliance::Solve(const Eigen::VectorXd& forces, Eigen::VectorXd& motion) const {
  round_->Solve(forces, motion);
  Eigen::VectorXf of_patch(change_.rows());
  Gather(motion, of_patch);
  Eigen::MatrixXf balancing = change_ * of_patch;
  factor_.Solve(balancing);
  Eigen::VectorXd left = forces;
  Subtract(balancing.col(0), left);
  round_->Solve(left, motion);
}

// What the inflated skin would do, less what the change of the patch holds back.
Eigen::MatrixXf PatchCompliance::Displacements(const LoadCases& cases) const {
  Eigen::MatrixXf displacements = round_->Displacements(cases);
  Eigen::MatrixXf of_patch = PatchMotions(cases);
  Eigen::MatrixXf balancing = change_ * of_patch;
  factor_.Solve(balancing);
  dense::AddProduct(-1.0F, Responses(), balancing, false, displacements);
  dense::AddProduct(-1.0F, compliance_, balancing, false, of_patch);
  for (const TouchedRow& row : touched_rows_) {
    displacements.row(row.row).setZero();
    for (const auto& [unknown, value] : row.entries)
      displacements.row(row.row) += value * of_patch.row(unknown);
  }
  return displacements;
}

// E' K0^-1 B.
Eigen::MatrixXf PatchCompliance::PatchMotions(const LoadCases& cases) const {
  Eigen::MatrixXf motions = Eigen::MatrixXf::Zero(change_.rows(), cases.count());
  for (const auto& [site, on] : cases.BySite(RoundCompliance::kFewLoads)) {
    const Vec2 turn = TurnOf(mechanics_.NodeOfSite(site));
    Eigen::Matrix<float, kNodeDofs, Eigen::Dynamic> turned = on.loads;
    const Eigen::Rotation2Df to_cylindrical(static_cast<float>(-std::atan2(turn.y(), turn.x())));
    turned.topRows<2>() = (to_cylindrical.toRotationMatrix() * turned.topRows<2>()).eval();
    for (size_t k = 0; k < sites_.size(); ++k) {
      const RoundCompliance::NodeBlock block = round_->BlockOf(sites_[k], site);
      for (Eigen::Index i = 0; i < turned.cols(); ++i)
        motions.col(on.cases[static_cast<size_t>(i)])
            .segment<kNodeDofs>(kNodeDofs * static_cast<Eigen::Index>(k)) += block.lazyProduct(turned.col(i));
    }
  }
  Eigen::VectorXd forces, motion;
  for (Eigen::Index i = 0; i < cases.count(); ++i) {
    if (cases[i].size() <= RoundCompliance::kFewLoads) continue;
    forces.setZero(jacobian_.cols());
    for (const auto& [site, load] : cases[i]) forces.segment<kNodeDofs>(kNodeDofs * site) += load;
    round_->Solve(forces, motion);
    Gather(motion, motions.col(i));
  }
  return motions;
}

// J0 K0^-1 E, made when it is asked for.
const Eigen::MatrixXf& PatchCompliance::Responses() const {
  if (responses_.size() > 0) return responses_;
  responses_.setZero(jacobian_.rows(), change_.rows());
  for (size_t i = 0; i < sites_.size(); ++i)
    round_->AddResponses(sites_[i],
                         responses_.middleCols<kNodeDofs>(kNodeDofs * static_cast<Eigen::Index>(i)));
  return responses_;
}

}  // namespace taclink

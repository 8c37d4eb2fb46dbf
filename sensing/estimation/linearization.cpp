#include "sensing/estimation/linearization.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "sensing/shell/node_steps.h"

namespace taclink {
namespace {

// Within this of a clamp, the normal of what presses is between the skin's and that at rest: the wall turns
// there within less than a body's width.
constexpr double kNearClampMm = 30, kOwnNormalShare = 0.35;

}  // namespace

Linearization::Linearization(const SkinMechanics& mechanics)
    : mechanics_(mechanics), frames_(static_cast<size_t>(mechanics.site_count())) {}

// Directors smoothed over neighbours: a body is smoother than a mesh.
void Linearization::SetFrames() {
  const ShellMesh& mesh = mechanics_.mesh();
  const auto at = [&](const std::vector<Vec3>& all, int column, int row) -> const Vec3& {
    return all[static_cast<size_t>(mesh.Node(column, row))];
  };
  std::vector<Vec3> smooth = state_.directors, along = smooth;
  for (int pass = 0; pass < 2; ++pass) {
    for (int row = 0; row < mesh.rows; ++row) {
      for (int c = 0; c < mesh.columns; ++c)
        along[static_cast<size_t>(mesh.Node(c, row))] =
            0.5 * at(smooth, c, row) + 0.25 * (at(smooth, c + 1, row) + at(smooth, c - 1, row));
    }
    smooth = along;
    for (int row = 1; row + 1 < mesh.rows; ++row) {
      for (int c = 0; c < mesh.columns; ++c)
        smooth[static_cast<size_t>(mesh.Node(c, row))] =
            0.5 * at(along, c, row) + 0.25 * (at(along, c, row + 1) + at(along, c, row - 1));
    }
  }
  for (int site = 0; site < mechanics_.site_count(); ++site) {
    const auto node = static_cast<size_t>(mechanics_.NodeOfSite(site));
    Vec3 normal = smooth[node].normalized();
    if (mechanics_.DistanceToClamp(site) < kNearClampMm * mechanics_.length_unit())
      normal = (kOwnNormalShare * normal + (1 - kOwnNormalShare) * mesh.normals[node]).normalized();
    const Vec3 radial = Vec3(mesh.mid_mm[node].x(), mesh.mid_mm[node].y(), 0).normalized();
    Vec3 around(-radial.y(), radial.x(), 0);
    around = (around - around.dot(normal) * normal).normalized();
    Mat3& frame = frames_[static_cast<size_t>(site)];
    frame.col(0) = -normal;
    frame.col(1) = around;
    frame.col(2) = normal.cross(around);
  }
}

// Rotations are about the tangent and about director x tangent.
Vec2 Linearization::Turning(int node, const Vec3& couple) const {
  const auto i = static_cast<size_t>(node);
  const Vec3& d = tangent_state_.directors[i];
  const Vec3& t = tangent_state_.tangents[i];
  return {couple.dot(t), couple.dot(d.cross(t))};
}

Vec2 Linearization::Moment(int node, const Vec3& direction) const {
  const Vec3& d = tangent_state_.directors[static_cast<size_t>(node)];
  return Turning(node, mechanics_.model().thickness_mm / 2 * d.cross(direction));
}

LoadCases::Load Linearization::ForceAt(Direction direction, int site) const {
  const Vec3 force = frames_[static_cast<size_t>(site)].col(direction);
  LoadCases::Load load = LoadCases::Load::Zero();
  load.head<3>() = force;
  if (direction != kInward) load.tail<2>() = Moment(mechanics_.NodeOfSite(site), force);
  return load;
}

LoadCases::Load Linearization::CoupleAt(Direction axis, int site) const {
  LoadCases::Load load = LoadCases::Load::Zero();
  load.tail<2>() = Turning(mechanics_.NodeOfSite(site), frames_[static_cast<size_t>(site)].col(axis));
  return load;
}

// (J K^-1 B)' = B' K^-1 J'.
std::array<Eigen::VectorXd, 3> Linearization::PulledAtSites(const Eigen::VectorXd& at_markers) {
  compliance_->Solve(compliance_->jacobian().transpose() * at_markers, motion_);
  std::array<Eigen::VectorXd, 3> pulled;
  for (auto& part : pulled) part.resize(mechanics_.site_count());
  for (int site = 0; site < mechanics_.site_count(); ++site) {
    const int node = mechanics_.NodeOfSite(site), dof = mechanics_.shell().Dof(node, 0);
    const Mat3& frame = frames_[static_cast<size_t>(site)];
    const auto move = motion_.segment<3>(dof);
    const auto turn = motion_.segment<2>(dof + 3);
    pulled[0][site] = frame.col(0).dot(move);
    for (int k = 1; k < 3; ++k)
      pulled[static_cast<size_t>(k)][site] = frame.col(k).dot(move) + Moment(node, frame.col(k)).dot(turn);
  }
  return pulled;
}

bool Linearization::At(const ShellState& state, const KnownLoads& loads) {
  if (!block_) block_ = std::make_unique<BlockCompliance>(mechanics_);
  round_.reset();
  compliance_ = block_.get();
  return block_->Set(state, loads.pressure_mpa) && Finish(state, loads);
}

bool Linearization::At(const ShellState& state, const KnownLoads& loads,
                       std::shared_ptr<const RoundCompliance> round, std::vector<int> patch) {
  if (!patch_) patch_ = std::make_unique<PatchCompliance>(mechanics_);
  round_.reset();
  compliance_ = patch_.get();
  return patch_->Set(std::move(round), state, loads.pressure_mpa, std::move(patch)) && Finish(state, loads);
}

bool Linearization::At(const std::shared_ptr<const InflatedSkin>& skin, const KnownLoads& loads) {
  round_ = std::make_shared<const RoundCompliance>(mechanics_, skin);
  compliance_ = round_.get();
  return Finish(skin->state, loads);
}

// All that does not depend on how the stiffness was factored.
bool Linearization::Finish(const ShellState& state, const KnownLoads& loads) {
  is_made_ = false;
  state_ = tangent_state_ = state;
  loads_ = loads;
  mechanics_.Gradient(state_, loads, gradient_);
  if (!gradient_.allFinite()) return false;
  mechanics_.GradientByLoads(state_, gradient_by_loads_);
  const MarkerMap::Jacobian& jacobian = compliance_->jacobian();
  mechanics_.markers().Displacements(state_, base_mm_);
  compliance_->Solve(gradient_, motion_);
  base_mm_.noalias() -= jacobian * motion_;
  by_known_loads_.setZero(jacobian.rows(), KnownLoads::kCount);
  for (int k = 0; k < KnownLoads::kCount; ++k) {
    if (gradient_by_loads_.col(k).isZero(0)) continue;
    compliance_->Solve(gradient_by_loads_.col(k), motion_);
    by_known_loads_.col(k).noalias() = -(jacobian * motion_);
  }
  tangent_loads_ = loads;
  tangent_gradient_ = gradient_;
  tangent_base_mm_ = base_mm_;
  SetFrames();
  is_made_ = base_mm_.allFinite() && by_known_loads_.allFinite();
  return is_made_;
}

void Linearization::SetKnownLoads(const KnownLoads& loads) {
  const Vec4 more = loads.Stacked() - loads_.Stacked();
  gradient_ += gradient_by_loads_ * more;
  base_mm_ += by_known_loads_ * more;
  loads_ = loads;
}

bool Linearization::Rebase(const ShellState& state, const KnownLoads& loads) {
  const bool is_tangent_state =
      state.mids_mm == tangent_state_.mids_mm && state.directors == tangent_state_.directors;
  state_ = state;
  loads_ = loads;
  if (is_tangent_state) {
    // The forces of known loads are linear in these.
    gradient_ = tangent_gradient_;
    base_mm_ = tangent_base_mm_;
    loads_ = tangent_loads_;
    SetKnownLoads(loads);
    return base_mm_.allFinite();
  }
  mechanics_.Gradient(state_, loads, gradient_);
  if (!gradient_.allFinite()) return false;
  compliance_->Solve(gradient_, motion_);
  mechanics_.markers().Displacements(state_, base_mm_);
  base_mm_.noalias() -= compliance_->jacobian() * motion_;
  return base_mm_.allFinite();
}

double Linearization::Step(const SiteLoads& loads, const Vec4& known_error, double longest_mm,
                           ShellState& state) {
  const NonlinearShell& shell = mechanics_.shell();
  Eigen::VectorXd force = -gradient_ - gradient_by_loads_ * known_error;
  for (int site = 0; site < mechanics_.site_count(); ++site) {
    const int node = mechanics_.NodeOfSite(site), dof = shell.Dof(node, 0);
    const Mat3& frame = frames_[static_cast<size_t>(site)];
    const Vec3 load = frame * Vec3(loads.forces_n[0][site], loads.forces_n[1][site], loads.forces_n[2][site]);
    const Vec3 tangential = load - frame.col(0).dot(load) * frame.col(0);
    const Vec3 couple = frame.rightCols<2>() * Vec2(loads.couples_nmm[0][site], loads.couples_nmm[1][site]);
    force.segment<3>(dof) += load;
    force.segment<2>(dof + 3) += Moment(node, tangential) + Turning(node, couple);
  }
  compliance_->Solve(force, motion_);
  const double longest = LongestTranslation(motion_);
  if (!std::isfinite(longest)) return longest;
  state = state_;
  shell.Step(std::min(1.0, longest_mm / std::max(longest, 1e-12)) * motion_, state);
  return longest;
}

void Linearization::FirstOrderMarkers(Eigen::VectorXd& stacked_mm) const {
  mechanics_.markers().Displacements(state_, stacked_mm);
  stacked_mm.noalias() += compliance_->jacobian() * motion_;
}

}  // namespace taclink

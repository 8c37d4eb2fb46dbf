#include "sensing/estimation/linearization.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace taclink {
namespace {

// Within this of a clamp, the normal of what presses is between the skin's and that at rest: the wall turns
// there within less than a body's width.
constexpr double kNearClampMm = 30, kOwnNormalShare = 0.35;

}  // namespace

Linearization::Linearization(const SkinMechanics& mechanics)
    : mechanics_(mechanics),
      hessian_(mechanics.shell().Pattern()),
      jacobian_(mechanics.markers().MakeJacobian(mechanics.shell())),
      place_(static_cast<size_t>(mechanics.site_count()), -1),
      frames_(static_cast<size_t>(mechanics.site_count())) {
  const Eigen::Index row_dofs = hessian_.rows() / mechanics.site_rows();
  filled_.resize(static_cast<size_t>(mechanics.site_rows()));
  for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
    for (MarkerMap::Jacobian::InnerIterator it(jacobian_, row); it; ++it) {
      BlockTridiagonal::Rows& rows = filled_[static_cast<size_t>(it.col() / row_dofs)];
      rows = rows.With({row, row + 1});
    }
  }
}

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

Eigen::MatrixXf Linearization::CoupleColumns(const Eigen::VectorXd& shares) const {
  Eigen::MatrixXf columns = Eigen::MatrixXf::Zero(jacobian_.rows(), 2);
  for (int site = 0; site < mechanics_.site_count(); ++site) {
    if (shares[site] == 0) continue;
    const int node = mechanics_.NodeOfSite(site);
    for (int k = 0; k < 2; ++k) {
      const Vec2 turning = shares[site] * Turning(node, frames_[static_cast<size_t>(site)].col(k + 1));
      columns.col(k) += AtSite(site).rightCols<2>().lazyProduct(turning.cast<float>());
    }
  }
  return columns;
}

// (J K^-1 B)' = B' K^-1 J'.
std::array<Eigen::VectorXd, 3> Linearization::PulledAtSites(const Eigen::VectorXd& at_markers) {
  Solve(jacobian_.transpose() * at_markers, motion_);
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
  is_made_ = false;
  rings_.reset();
  state_ = tangent_state_ = state;
  mechanics_.shell().Hessian(state_, AppliedLoads(mechanics_, loads).loads(), gradient_, hessian_);
  if (!factor_) factor_.emplace(hessian_.rows() / mechanics_.site_rows(), mechanics_.site_rows());
  return gradient_.allFinite() && factor_->Factorise(hessian_) && Finish(loads);
}

bool Linearization::At(const std::shared_ptr<const InflatedSkin>& skin, const KnownLoads& loads) {
  is_made_ = false;
  rings_ = {skin, &skin->stiffness};
  state_ = tangent_state_ = skin->state;
  mechanics_.shell().Gradient(state_, AppliedLoads(mechanics_, loads).loads(), gradient_);
  return gradient_.allFinite() && Finish(loads);
}

void Linearization::Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const {
  if (rings_)
    rings_->Solve(rhs, x);
  else
    factor_->Solve(rhs, x);
}

// All that does not depend on how the stiffness was factored.
bool Linearization::Finish(const KnownLoads& loads) {
  loads_ = loads;
  mechanics_.GradientByLoads(state_, gradient_by_loads_);
  const MarkerMap& map = mechanics_.markers();
  map.WriteJacobian(mechanics_.shell(), state_, jacobian_);
  DropColumns();
  first_columns_.resize(0, 0);
  map.Displacements(state_, base_mm_);
  Solve(gradient_, motion_);
  base_mm_.noalias() -= jacobian_ * motion_;
  by_known_loads_.setZero(jacobian_.rows(), KnownLoads::kCount);
  for (int k = 0; k < KnownLoads::kCount; ++k) {
    if (gradient_by_loads_.col(k).isZero(0)) continue;
    Solve(gradient_by_loads_.col(k), motion_);
    by_known_loads_.col(k).noalias() = -(jacobian_ * motion_);
  }
  tangent_loads_ = loads;
  tangent_gradient_ = gradient_;
  tangent_base_mm_ = base_mm_;
  SetFrames();
  is_made_ = base_mm_.allFinite() && by_known_loads_.allFinite();
  return is_made_;
}

void Linearization::DropColumns() {
  place_.assign(place_.size(), -1);
  adjoint_.resize(0, 0);
}

// From the markers' side or from the sites', whichever is less.
void Linearization::MakeColumns(std::span<const int> sites) {
  std::vector<int> missing;
  for (const int site : sites) {
    Eigen::Index& place = place_[static_cast<size_t>(site)];
    if (place >= 0) continue;
    place = adjoint_.cols() / kNodeDofs + static_cast<Eigen::Index>(missing.size());
    missing.push_back(site);
  }
  if (missing.empty()) return;
  if (rings_)
    MakeTurnedColumns(missing);
  else if (kNodeDofs * static_cast<Eigen::Index>(missing.size()) < jacobian_.rows())
    MakeNodeColumns(missing);
  else
    MakeColumnsFromMarkers(missing);
}

void Linearization::MakeColumnsFromMarkers(const std::vector<int>& missing) {
  Eigen::MatrixXf rows = Eigen::MatrixXf::Zero(jacobian_.rows(), jacobian_.cols());
  for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
    for (MarkerMap::Jacobian::InnerIterator it(jacobian_, row); it; ++it)
      rows(row, it.col()) = static_cast<float>(it.value());
  }
  factor_->SolveRows(filled_, rows);
  Eigen::Index to = adjoint_.cols();
  adjoint_.conservativeResize(jacobian_.rows(), to + kNodeDofs * static_cast<Eigen::Index>(missing.size()));
  for (const int site : missing) {
    adjoint_.middleCols<kNodeDofs>(to) =
        rows.middleCols<kNodeDofs>(mechanics_.shell().Dof(mechanics_.NodeOfSite(site), 0));
    to += kNodeDofs;
  }
}

void Linearization::MakeNodeColumns(const std::vector<int>& missing) {
  const Eigen::Index row_dofs = hessian_.rows() / mechanics_.site_rows();
  const auto count = kNodeDofs * static_cast<Eigen::Index>(missing.size());
  Eigen::MatrixXf loads = Eigen::MatrixXf::Zero(count, hessian_.rows());
  std::vector<BlockTridiagonal::Rows> filled(static_cast<size_t>(mechanics_.site_rows()));
  Eigen::Index row = 0;
  for (const int site : missing) {
    const int dof = mechanics_.shell().Dof(mechanics_.NodeOfSite(site), 0);
    loads.block<kNodeDofs, kNodeDofs>(row, dof).setIdentity();
    BlockTridiagonal::Rows& rows = filled[static_cast<size_t>(dof / row_dofs)];
    rows = rows.With({row, row + kNodeDofs});
    row += kNodeDofs;
  }
  adjoint_.conservativeResize(jacobian_.rows(), adjoint_.cols() + count);
  adjoint_.rightCols(count) = Solved(std::move(filled), std::move(loads));
}

// Of the sites between two paths of markers, row by row. K^-1 J' of the markers of one path gives how these
// respond to loads at all sites; what a load does to another path is that, rotated.
void Linearization::MakeFirstColumns() {
  const int parts = mechanics_.mesh().refinement, around = mechanics_.columns(), paths = around / parts;
  const Eigen::Index sites = parts * mechanics_.site_rows(), rings = jacobian_.rows() / (3 * paths);
  first_columns_.resize(jacobian_.rows(), kNodeDofs * sites);
  std::array<Eigen::VectorXd, 3> pulled;
  for (Eigen::Index ring = 0; ring < rings; ++ring) {
    for (Eigen::Index c = 0; c < 3; ++c)
      rings_->Solve(jacobian_.row(3 * ring * paths + c).transpose(), pulled[static_cast<size_t>(c)]);
    for (int path = 0; path < paths; ++path) {
      Mat3 turn = Mat3::Identity();
      turn.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(2 * kPi * path / paths).toRotationMatrix();
      for (Eigen::Index i = 0; i < sites; ++i) {
        const int row = static_cast<int>(i) / parts, column = static_cast<int>(i) % parts - path * parts;
        const int site = row * around + (column + around) % around;
        const int dof = mechanics_.shell().Dof(mechanics_.NodeOfSite(site), 0);
        Eigen::Matrix<double, 3, kNodeDofs> response;
        for (Eigen::Index c = 0; c < 3; ++c)
          response.row(c) = pulled[static_cast<size_t>(c)].segment<kNodeDofs>(dof).transpose();
        response = (turn * response).eval();
        response.leftCols<3>() = (response.leftCols<3>() * turn.transpose()).eval();
        first_columns_.block<3, kNodeDofs>(3 * (ring * paths + path), kNodeDofs * i) = response.cast<float>();
      }
    }
  }
}

// A skin of revolution with its markers, turned by the angle between two paths, is itself.
void Linearization::MakeTurnedColumns(const std::vector<int>& missing) {
  if (first_columns_.size() == 0) MakeFirstColumns();
  const int parts = mechanics_.mesh().refinement, paths = mechanics_.columns() / parts;
  const Eigen::Index rings = jacobian_.rows() / (3 * paths);
  Eigen::Index to = adjoint_.cols();
  adjoint_.conservativeResize(jacobian_.rows(), to + kNodeDofs * static_cast<Eigen::Index>(missing.size()));
  for (const int site : missing) {
    const int row = site / mechanics_.columns(), column = site % mechanics_.columns();
    const int by = column / parts;
    const auto angle = static_cast<float>(2 * kPi * by / paths), c = std::cos(angle), s = std::sin(angle);
    for (Eigen::Index dof = 0; dof < kNodeDofs; ++dof, ++to) {
      const float* from = first_columns_.col(kNodeDofs * (row * parts + column % parts) + dof).data();
      float* turned = adjoint_.col(to).data();
      for (Eigen::Index marker = 0; marker < rings * paths; ++marker) {
        const Eigen::Index path = marker % paths, before = path < by ? path - by + paths : path - by;
        const float* v = from + 3 * (marker - path + before);
        turned[3 * marker] = c * v[0] - s * v[1];
        turned[3 * marker + 1] = s * v[0] + c * v[1];
        turned[3 * marker + 2] = v[2];
      }
    }
    // The loads along x and y are turned, too.
    auto x = adjoint_.col(to - kNodeDofs), y = adjoint_.col(to - kNodeDofs + 1);
    const Eigen::VectorXf along_x = c * x - s * y;
    y = (s * x + c * y).eval();
    x = along_x;
  }
}

// What these loads displace, which are rows: J (K^-1 loads').
Eigen::MatrixXf Linearization::Solved(std::vector<BlockTridiagonal::Rows> filled,
                                      Eigen::MatrixXf loads) const {
  if (rings_) {
    Eigen::MatrixXf moved(jacobian_.rows(), loads.rows());
    Eigen::VectorXd motion;
    for (Eigen::Index row = 0; row < loads.rows(); ++row) {
      rings_->Solve(loads.row(row).transpose().cast<double>(), motion);
      moved.col(row) = (jacobian_ * motion).cast<float>();
    }
    return moved;
  }
  factor_->SolveRows(std::move(filled), loads);
  Eigen::MatrixXf moved = Eigen::MatrixXf::Zero(loads.rows(), jacobian_.rows());
  for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
    for (MarkerMap::Jacobian::InnerIterator it(jacobian_, row); it; ++it)
      moved.col(row) += static_cast<float>(it.value()) * loads.col(it.col());
  }
  return moved.transpose();
}

Eigen::MatrixXf Linearization::RingColumns() const {
  const int around = mechanics_.columns(), rings = mechanics_.site_rows();
  Eigen::MatrixXf loads = Eigen::MatrixXf::Zero(rings, hessian_.rows());
  std::vector<BlockTridiagonal::Rows> filled(static_cast<size_t>(rings));
  for (int ring = 0; ring < rings; ++ring) {
    for (int i = 0; i < around; ++i) {
      const int site = ring * around + i;
      for (Eigen::SparseMatrix<double>::InnerIterator it(mechanics_.spread(), site); it; ++it) {
        const auto loaded = static_cast<int>(it.row());
        const int dof = mechanics_.shell().Dof(mechanics_.NodeOfSite(loaded), 0);
        const Vec3 force = it.value() / around * frames_[static_cast<size_t>(loaded)].col(kInward);
        loads.block<1, 3>(ring, dof) += force.transpose().cast<float>();
        BlockTridiagonal::Rows& rows = filled[static_cast<size_t>(loaded / around)];
        rows = rows.With({ring, ring + 1});
      }
    }
  }
  return Solved(std::move(filled), std::move(loads));
}

Eigen::VectorXf Linearization::Column(Direction direction, int site) const {
  assert(place_[static_cast<size_t>(site)] >= 0);
  const int node = mechanics_.NodeOfSite(site);
  const Vec3 force = frames_[static_cast<size_t>(site)].col(direction);
  const Vec2 moment = direction == kInward ? Vec2::Zero() : Moment(node, force);
  Eigen::Matrix<float, kNodeDofs, 1> load;
  load << force.cast<float>(), moment.cast<float>();
  return AtSite(site).lazyProduct(load);
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
  mechanics_.shell().Gradient(state_, AppliedLoads(mechanics_, loads).loads(), gradient_);
  if (!gradient_.allFinite()) return false;
  Solve(gradient_, motion_);
  mechanics_.markers().Displacements(state_, base_mm_);
  base_mm_.noalias() -= jacobian_ * motion_;
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
  Solve(force, motion_);
  double longest = 0;
  for (int node = 0; node < shell.node_count(); ++node) {
    if (const int dof = shell.Dof(node, 0); dof >= 0)
      longest = std::max(longest, motion_.segment<3>(dof).norm());
  }
  if (!std::isfinite(longest)) return longest;
  state = state_;
  shell.Step(std::min(1.0, longest_mm / std::max(longest, 1e-12)) * motion_, state);
  return longest;
}

void Linearization::FirstOrderMarkers(Eigen::VectorXd& stacked_mm) const {
  mechanics_.markers().Displacements(state_, stacked_mm);
  stacked_mm.noalias() += jacobian_ * motion_;
}

}  // namespace taclink

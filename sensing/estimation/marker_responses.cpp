#include "sensing/estimation/marker_responses.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <utility>

namespace taclink {

MarkerResponses::MarkerResponses(const SkinMechanics& mechanics, const MarkerMap::Jacobian& jacobian)
    : mechanics_(mechanics),
      jacobian_(jacobian),
      filled_(static_cast<size_t>(mechanics.site_rows())),
      place_(static_cast<size_t>(mechanics.site_count()), -1) {
  const Eigen::Index row_dofs = jacobian.cols() / mechanics.site_rows();
  for (Eigen::Index row = 0; row < jacobian.rows(); ++row) {
    for (MarkerMap::Jacobian::InnerIterator it(jacobian, row); it; ++it) {
      BlockTridiagonal::Rows& rows = filled_[static_cast<size_t>(it.col() / row_dofs)];
      rows = rows.With({row, row + 1});
    }
  }
}

MarkerResponses::LoadRows::LoadRows(const SkinMechanics& mechanics, Eigen::Index count)
    : loads(Eigen::MatrixXf::Zero(count, mechanics.shell().dof_count())),
      filled(static_cast<size_t>(mechanics.site_rows())),
      row_dofs(mechanics.shell().dof_count() / mechanics.site_rows()) {}

void MarkerResponses::LoadRows::Fill(Eigen::Index row, int dof) {
  BlockTridiagonal::Rows& rows = filled[static_cast<size_t>(dof / row_dofs)];
  rows = rows.With({row, row + 1});
}

void MarkerResponses::Clear() {
  Drop();
  first_.resize(0, 0);
}

void MarkerResponses::Drop() {
  place_.assign(place_.size(), -1);
  made_.resize(0, 0);
}

// From the markers' side or from the sites', whichever is less.
void MarkerResponses::Make(const SkinStiffness& stiffness, std::span<const int> sites) {
  std::vector<int> missing;
  for (const int site : sites) {
    Eigen::Index& place = place_[static_cast<size_t>(site)];
    if (place >= 0) continue;
    place = made_.cols() / kNodeDofs + static_cast<Eigen::Index>(missing.size());
    missing.push_back(site);
  }
  if (missing.empty()) return;
  if (stiffness.is_of_revolution())
    MakeRotated(stiffness, missing);
  else if (kNodeDofs * static_cast<Eigen::Index>(missing.size()) < jacobian_.rows())
    MakeFromNodes(stiffness, missing);
  else
    MakeFromMarkers(stiffness, missing);
}

void MarkerResponses::MakeFromMarkers(const SkinStiffness& stiffness, const std::vector<int>& missing) {
  Eigen::MatrixXf rows = Eigen::MatrixXf::Zero(jacobian_.rows(), jacobian_.cols());
  for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
    for (MarkerMap::Jacobian::InnerIterator it(jacobian_, row); it; ++it)
      rows(row, it.col()) = static_cast<float>(it.value());
  }
  stiffness.SolveRows(filled_, rows);
  Eigen::Index to = made_.cols();
  made_.conservativeResize(jacobian_.rows(), to + kNodeDofs * static_cast<Eigen::Index>(missing.size()));
  for (const int site : missing) {
    made_.middleCols<kNodeDofs>(to) =
        rows.middleCols<kNodeDofs>(mechanics_.shell().Dof(mechanics_.NodeOfSite(site), 0));
    to += kNodeDofs;
  }
}

void MarkerResponses::MakeFromNodes(const SkinStiffness& stiffness, const std::vector<int>& missing) {
  const auto count = kNodeDofs * static_cast<Eigen::Index>(missing.size());
  LoadRows rows(mechanics_, count);
  Eigen::Index row = 0;
  for (const int site : missing) {
    const int dof = mechanics_.shell().Dof(mechanics_.NodeOfSite(site), 0);
    rows.loads.block<kNodeDofs, kNodeDofs>(row, dof).setIdentity();
    for (int c = 0; c < kNodeDofs; ++c) rows.Fill(row++, dof);
  }
  made_.conservativeResize(jacobian_.rows(), made_.cols() + count);
  made_.rightCols(count) = Of(stiffness, std::move(rows));
}

// Of the sites between two paths of markers, row by row. K^-1 J' of the markers of one path gives how these
// respond to loads at all sites; what a load does to another path is that, rotated.
void MarkerResponses::MakeFirst(const SkinStiffness& stiffness) {
  const int parts = mechanics_.mesh().refinement, around = mechanics_.columns(), paths = around / parts;
  const Eigen::Index sites = parts * mechanics_.site_rows(), rings = jacobian_.rows() / (3 * paths);
  first_.resize(jacobian_.rows(), kNodeDofs * sites);
  std::array<Eigen::VectorXd, 3> pulled;
  for (Eigen::Index ring = 0; ring < rings; ++ring) {
    for (Eigen::Index c = 0; c < 3; ++c)
      stiffness.Solve(jacobian_.row(3 * ring * paths + c).transpose(), pulled[static_cast<size_t>(c)]);
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
        first_.block<3, kNodeDofs>(3 * (ring * paths + path), kNodeDofs * i) = response.cast<float>();
      }
    }
  }
}

// A skin of revolution with its markers, turned by the angle between two paths, is itself.
void MarkerResponses::MakeRotated(const SkinStiffness& stiffness, const std::vector<int>& missing) {
  if (first_.size() == 0) MakeFirst(stiffness);
  const int parts = mechanics_.mesh().refinement, paths = mechanics_.columns() / parts;
  const Eigen::Index rings = jacobian_.rows() / (3 * paths);
  Eigen::Index to = made_.cols();
  made_.conservativeResize(jacobian_.rows(), to + kNodeDofs * static_cast<Eigen::Index>(missing.size()));
  for (const int site : missing) {
    const int row = site / mechanics_.columns(), column = site % mechanics_.columns();
    const int by = column / parts;
    const auto angle = static_cast<float>(2 * kPi * by / paths), c = std::cos(angle), s = std::sin(angle);
    for (Eigen::Index dof = 0; dof < kNodeDofs; ++dof, ++to) {
      const float* from = first_.col(kNodeDofs * (row * parts + column % parts) + dof).data();
      float* turned = made_.col(to).data();
      for (Eigen::Index marker = 0; marker < rings * paths; ++marker) {
        const Eigen::Index path = marker % paths, before = path < by ? path - by + paths : path - by;
        const float* v = from + 3 * (marker - path + before);
        turned[3 * marker] = c * v[0] - s * v[1];
        turned[3 * marker + 1] = s * v[0] + c * v[1];
        turned[3 * marker + 2] = v[2];
      }
    }
    // The loads along x and y are turned, too.
    auto x = made_.col(to - kNodeDofs), y = made_.col(to - kNodeDofs + 1);
    const Eigen::VectorXf along_x = c * x - s * y;
    y = (s * x + c * y).eval();
    x = along_x;
  }
}

Eigen::MatrixXf MarkerResponses::Of(const SkinStiffness& stiffness, LoadRows rows) const {
  stiffness.SolveRows(std::move(rows.filled), rows.loads);
  Eigen::MatrixXf moved = Eigen::MatrixXf::Zero(rows.loads.rows(), jacobian_.rows());
  for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
    for (MarkerMap::Jacobian::InnerIterator it(jacobian_, row); it; ++it)
      moved.col(row) += static_cast<float>(it.value()) * rows.loads.col(it.col());
  }
  return moved.transpose();
}

}  // namespace taclink

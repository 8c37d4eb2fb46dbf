#include "sensing/estimation/block_compliance.h"

#include <utility>

namespace taclink {

BlockCompliance::BlockCompliance(const SkinMechanics& mechanics)
    : mechanics_(mechanics),
      hessian_(mechanics.shell().Pattern()),
      factor_(hessian_.rows() / mechanics.site_rows(), mechanics.site_rows()),
      jacobian_(mechanics.markers().MakeJacobian(mechanics.shell())) {}

bool BlockCompliance::Set(const ShellState& state, double pressure_mpa) {
  const NonlinearShell& shell = mechanics_.shell();
  const PressureLoads pressure(pressure_mpa);
  Eigen::VectorXd gradient;
  shell.Hessian(state, pressure.loads(), gradient, hessian_);
  mechanics_.markers().WriteJacobian(shell, state, jacobian_);
  return gradient.allFinite() && factor_.Factorise(hessian_);
}

void BlockCompliance::Solve(const Eigen::VectorXd& forces, Eigen::VectorXd& motion) const {
  factor_.Solve(forces, motion);
}

Eigen::MatrixXf BlockCompliance::Displacements(const LoadCases& cases) const {
  Eigen::MatrixXf rows = Eigen::MatrixXf::Zero(cases.count(), jacobian_.cols());
  std::vector<BlockTridiagonal::Rows> filled(static_cast<size_t>(mechanics_.site_rows()));
  for (Eigen::Index i = 0; i < cases.count(); ++i) {
    for (const auto& [site, load] : cases[i]) {
      rows.block<1, kNodeDofs>(i, kNodeDofs * site) += load.transpose().cast<float>();
      BlockTridiagonal::Rows& in_row = filled[static_cast<size_t>(site / mechanics_.columns())];
      in_row = in_row.With({i, i + 1});
    }
  }
  factor_.SolveRows(std::move(filled), rows);
  Eigen::MatrixXf moved = Eigen::MatrixXf::Zero(rows.rows(), jacobian_.rows());
  for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
    for (MarkerMap::Jacobian::InnerIterator it(jacobian_, row); it; ++it)
      moved.col(row) += static_cast<float>(it.value()) * rows.col(it.col());
  }
  return moved.transpose();
}

}  // namespace taclink

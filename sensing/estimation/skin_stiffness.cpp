#include "sensing/estimation/skin_stiffness.h"

#include <utility>

namespace taclink {

SkinStiffness::SkinStiffness(const SkinMechanics& mechanics) : mechanics_(mechanics) {}

bool SkinStiffness::Set(const ShellState& state, const KnownLoads& loads, Eigen::VectorXd& gradient) {
  rings_.reset();
  if (!factor_) {
    hessian_ = mechanics_.shell().Pattern();
    factor_.emplace(hessian_.rows() / mechanics_.site_rows(), mechanics_.site_rows());
  }
  mechanics_.shell().Hessian(state, AppliedLoads(mechanics_, loads).loads(), gradient, hessian_);
  return gradient.allFinite() && factor_->Factorise(hessian_);
}

void SkinStiffness::Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const {
  if (rings_)
    rings_->Solve(rhs, x);
  else
    factor_->Solve(rhs, x);
}

void SkinStiffness::SolveRows(std::vector<BlockTridiagonal::Rows> filled, Eigen::MatrixXf& rows) const {
  if (!rings_) return factor_->SolveRows(std::move(filled), rows);
  Eigen::VectorXd solved;
  for (Eigen::Index row = 0; row < rows.rows(); ++row) {
    rings_->Solve(rows.row(row).transpose().cast<double>(), solved);
    rows.row(row) = solved.transpose().cast<float>();
  }
}

}  // namespace taclink

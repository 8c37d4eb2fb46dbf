#pragma once

#include <array>
#include <vector>

#include "sensing/force/load_sites.h"
#include "sensing/mechanics/nonlinear_shell.h"
#include "sensing/mechanics/sparse_cholesky.h"

namespace taclink {

/// The nonlinear shell near equilibrium under a pressure and loads on sites, with a factorised tangent that
/// is kept from frame to frame: for one thread. Forces are N, inwards, around and along the axis.
class LoadedShell {
 public:
  LoadedShell(const LinkModel& link, int refinement);

  struct Load {
    int site = 0;
    double load_n = 0;               // inwards
    Vec2 sideways_n = Vec2::Zero();  // around and along the axis
    // Per N inwards, around and along the axis, by the tangent.
    Eigen::MatrixXd motions;                 // of the shell, by degree of freedom
    std::array<Eigen::VectorXd, 3> columns;  // of the markers, mm
  };
  using Loads = std::vector<Load>;
  struct Force {
    double inward_n = 0;
    Vec2 sideways_n = Vec2::Zero();
  };

  const LinkModel& model() const { return model_; }
  const ShellMesh& mesh() const { return mesh_; }
  const LoadSites& sites() const { return sites_; }
  const ShellState& state() const { return state_; }
  const Loads& loads() const { return loads_; }
  long factorisations() const { return factorisations_; }

  /// Unstressed, without loads and without a tangent.
  void Rest();
  /// At the inflated skin, whose factor is kept for pressures of like `coordinate` (PressurisedTangents): a
  /// touch begins without a new one. False: the skin is unstable.
  bool BeginTouch(const ShellState& inflated, double pressure_mpa, double coordinate);
  bool has_tangent() const { return in_use_ != nullptr; }
  /// The largest force or moment that is out of balance, which Settle takes away.
  double Unbalance(double pressure_mpa);
  /// A new tangent at the state. False: none of use.
  bool MakeTangent(double pressure_mpa);
  /// What brings the shell back to equilibrium by the tangent, for Advance. Returns the markers' motions, mm.
  const Eigen::VectorXd& Settle();

  Loads::const_iterator Find(int site) const;
  /// Of size zero until Advance.
  Loads::const_iterator Add(int site);
  /// Settles, and changes the loads to `wanted`, by index; those that no longer push are gone after it. Steps
  /// are cut at a length. Returns the longest motion of a node, uncut, mm.
  double Advance(const std::vector<Force>& wanted);

 private:
  void SubtractLoads();
  bool HoldAndFactorise(double stiffness_n_mm, double& held_by);
  void UndoHolding(double held_by);
  void AddForce(int site, int direction, double load_n, Eigen::Ref<Eigen::VectorXd> force) const;
  void SolveColumns(Load& load);
  void Solve(const Eigen::MatrixXd& by_forces, Eigen::MatrixXd& motions);
  void RemoveGone();

  LinkModel model_;
  ShellMesh mesh_;
  NonlinearShell shell_;
  LoadSites sites_;
  Eigen::SparseMatrix<double> hessian_;
  SparseCholesky factor_;
  SparseCholesky rest_factor_;  // of the skin that nothing touches, at the pressure of rest_coordinate_
  double rest_coordinate_;
  SparseCholesky* in_use_ = nullptr;
  long factorisations_ = 0;
  // Springs that hold the loaded nodes in the factorised matrix, and what undoes them in a solution.
  std::vector<int> held_;         // first degrees of freedom of those nodes
  Eigen::MatrixXd held_motions_;  // of the shell, by a force on each of their directions
  Eigen::MatrixXd held_undo_;     // (1 / stiffness - compliance of the held)^-1

  ShellState state_;  // in equilibrium with loads_, nearly
  Loads loads_;       // those that act on it
  Loads idle_;        // acted since the last tangent: markers' noise calls them again and again
  Eigen::VectorXd gradient_, step_, settle_columns_;
  Eigen::MatrixXd out_of_balance_, settle_, forces_, unit_forces_, at_held_;
};

}  // namespace taclink

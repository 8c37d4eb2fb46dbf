#pragma once

#include <Eigen/Core>

#include "sensing/estimation/load_cases.h"
#include "sensing/shell/marker_map.h"

namespace taclink {

/// How a skin responds to loads to first order about a state: by the inverse of a tangent stiffness K and the
/// Jacobian J of its markers. One thread.
class SkinCompliance {
 public:
  virtual ~SkinCompliance() = default;
  /// motion := K^-1 forces, by the shell's degrees of freedom.
  virtual void Solve(const Eigen::VectorXd& forces, Eigen::VectorXd& motion) const = 0;
  virtual const MarkerMap::Jacobian& jacobian() const = 0;
  /// J K^-1 B: displacements of the stacked markers, mm, one column per case.
  virtual Eigen::MatrixXf Displacements(const LoadCases& cases) const = 0;

 protected:
  SkinCompliance() = default;
  SkinCompliance(const SkinCompliance&) = delete;
  SkinCompliance& operator=(const SkinCompliance&) = delete;
};

}  // namespace taclink

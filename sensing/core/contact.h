#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sensing/core/geometry.h"

namespace taclink {

/// How displacements become forces; from the thesis' own to the most exact.
enum class ForceModel : uint8_t {
  kLiteral,      ///< stiffness times displacements with zero rotations, (6.1): for comparison only
  kLinear,       ///< small displacements, no pressure
  kPressurised,  ///< small displacements about the skin inflated by the pressure
  kNonlinear,    ///< large displacements
};
inline constexpr ForceModel kForceModels[] = {ForceModel::kLiteral, ForceModel::kLinear,
                                              ForceModel::kPressurised, ForceModel::kNonlinear};
constexpr const char* Name(ForceModel model) {
  switch (model) {
    case ForceModel::kLiteral:
      return "literal";
    case ForceModel::kLinear:
      return "linear";
    case ForceModel::kPressurised:
      return "pressurised";
    case ForceModel::kNonlinear:
      return "nonlinear";
  }
  return "unknown";
}

/// What the world exerts on the skin, lumped at the markers' places on the mid-surface. Link frame, N.
struct NodalForces {
  ForceModel model = ForceModel::kLinear;
  std::vector<Vec3> forces_n;    ///< by marker index
  std::vector<double> sigmas_n;  ///< by marker index: standard deviation of the force; 0 where there is none
  std::vector<int> loaded;       ///< indices of the markers with a force
  /// Of the forces of `loaded`, in its order, three numbers each; N^2. May be larger, so as to be reused;
  /// then the rest is 0.
  Eigen::MatrixXd loaded_covariance;
  double residual = 0;    ///< RMS of the unexplained displacement, in standard deviations
  bool converged = true;  ///< false: the solver stopped at its limit of loads
};

/// A connected region of the skin that something pushes on. Link frame.
struct Contact {
  uint64_t id = 0;                            ///< lasts while the contact does; unique within a link's run
  Vec3 center_mm = Vec3::Zero();              ///< on the deformed outer surface
  Vec3 normal = Vec3::Zero();                 ///< unit, of the deformed skin, away from the axis
  Vec3 force_n = Vec3::Zero();                ///< what the world exerts on the skin
  std::optional<Mat3> force_covariance_n2;    ///< none: not known
  std::optional<Mat3> center_covariance_mm2;  ///< likewise
  double normal_force_n = 0;                  ///< pressing in is positive
  double area_mm2 = 0;                        ///< of the loaded region, no finer than the marker grid
  std::vector<int> markers;                   ///< indices of the loaded markers
};

}  // namespace taclink

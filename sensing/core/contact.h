#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sensing/core/geometry.h"

namespace taclink {

enum class ForceModel : uint8_t { kLinear };
constexpr const char* Name(ForceModel model) {
  return model == ForceModel::kLinear ? "linear" : "unknown";
}

/// What the world exerts on the skin, lumped at the markers' places on the mid-surface. Link frame, N.
struct NodalForces {
  ForceModel model = ForceModel::kLinear;
  std::vector<Vec3> forces_n;    ///< by marker index
  std::vector<double> sigmas_n;  ///< by marker index: standard deviation of the force; 0 where there is none
  std::vector<int> loaded;       ///< indices of the markers with a force
  /// Of the inward forces of `loaded`, in its order; N^2. May be larger, so as to be reused; then the rest is
  /// 0.
  Eigen::MatrixXd loaded_covariance;
  double residual = 0;    ///< RMS of the unexplained displacement, in standard deviations
  bool converged = true;  ///< false: the solver stopped at its limit of loads
};

/// A connected region of the skin that something pushes on. Link frame.
struct Contact {
  uint64_t id = 0;                    ///< lasts while the contact does; unique within a link's run
  Vec3 center_mm = Vec3::Zero();      ///< on the deformed outer surface
  Vec3 normal = Vec3::Zero();         ///< unit, of the deformed skin, away from the axis
  Vec3 force_n = Vec3::Zero();        ///< what the world exerts on the skin
  std::optional<Vec3> force_sigma_n;  ///< standard deviation of each component; none: not known
  double normal_force_n = 0;          ///< pressing in is positive
  double area_mm2 = 0;                ///< of the loaded region, no finer than the marker grid
  std::vector<int> markers;           ///< indices of the loaded markers
};

}  // namespace taclink

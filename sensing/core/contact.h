#pragma once

#include <algorithm>
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
  /// By marker index: limit of detection, the weakest inward force of a body there that would be found 95
  /// times in 100, where nothing else presses nearby. Empty: not known.
  std::vector<double> limits_n;
  /// Likewise of what presses alike all around at one place along the link: its sum, between the outer rings
  /// where it shows least. Known where the others are.
  double limit_around_n = 0;
  double residual = 0;         ///< RMS of what the estimate does not explain, in standard deviations
  double region_residual = 0;  ///< chi^2 per number of the worst region of 3 x 3 markers
  /// How far cameras that have moved or changed since the baseline would put markers off, of the marker that
  /// they put off most. It is taken off.
  double camera_shift_mm = 0;
  bool converged = true;  ///< false: there is no estimate, the forces are none
};

/// A contact keeps its identity while its center moves less than this from one frame to the next, mm; times
/// LengthUnit of the skin.
inline constexpr double kSameContactMm = 30;

/// A connected region of the skin that something pushes on. Link frame.
struct Contact {
  uint64_t id = 0;                          ///< lasts while the contact does; unique within a link's run
  bool is_ring_contact = false;             ///< presses evenly around the whole circumference
  Vec3 center_mm = Vec3::Zero();            ///< on the deformed outer surface; of a ring contact, on the axis
  Vec3 normal = Vec3::Zero();               ///< unit, of the deformed skin, away from the axis
  Vec3 force_n = Vec3::Zero();              ///< what the world exerts on the skin
  std::optional<Mat3> force_covariance_n2;  ///< none: not known
  std::optional<Mat3> center_covariance_mm2;  ///< likewise
  /// Integral of the inward load; nonzero also for a ring contact, whose resultant is about zero.
  double normal_force_n = 0;
  double area_mm2 = 0;             ///< of the loaded region, no finer than the marker grid
  std::vector<int> markers;        ///< indices of the loaded markers
  Vec3 moment_nmm = Vec3::Zero();  ///< of the load about the link frame's origin
  double peak_pressure_mpa = 0;    ///< of the inward load, over a cell of the load grid
  /// Of the load's spread over the skin: along its longer and its shorter axis, as long as the standard
  /// deviation of the load along it.
  Vec3 major_axis_mm = Vec3::Zero(), minor_axis_mm = Vec3::Zero();
  /// A polygon round the loaded region on the deformed outer surface, counter-clockwise seen from outside;
  /// convex on the unrolled skin, a ring contact's cut open on the other side of `normal`. Empty: not known.
  std::vector<Vec3> outline_mm;

  /// How strongly it acts on the skin, N: normal_force_n or |force_n|, the larger one. What presses from
  /// opposite sides cancels in the resultant; what drags on the skin is not in the normal force.
  double magnitude_n() const { return std::max(normal_force_n, force_n.norm()); }
};

}  // namespace taclink

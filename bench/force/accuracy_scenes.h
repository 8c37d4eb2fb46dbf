#pragma once

#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/shell/rigid_body.h"

namespace taclink {

/// What presses on the skin in a path of the accuracy bench.
enum class PressKind : int {
  kRest,           ///< nothing: inflated only
  kStampMarker,    ///< flat stamp of 5.5 mm on a marker
  kStampBetween,   ///< the same, in the middle of four markers
  kSphereMarker,   ///< sphere of radius 10 mm
  kSphereBetween,  ///< the same, in the middle of four markers
  kStampEnd,       ///< stamp on the ring next to the clamped end
  kSphereEnd,      ///< sphere between the last two rings
  kTwo,            ///< a stamp and a sphere
  kThree,          ///< three spheres
  kPlate,          ///< flat disc of 50 mm
  kPinch,          ///< two opposite spheres
  kBar,            ///< endless bar of radius 8 mm, oblique to the axis
  kDrag,           ///< sticking sphere, pushed in and then dragged sideways
};
inline constexpr int kPressKindCount = 13;
const char* Name(PressKind kind);

struct PressBody {
  RigidBody touching;  ///< where it touches the undeformed skin: depth 0
  Vec3 into;           ///< unit, the way of the push
  Vec3 along;          ///< unit, the way of the drag
  bool sticks = false;

  Vec3 Offset(double depth_mm, double drag_mm) const { return depth_mm * into + drag_mm * along; }
};

/// How large and how stiff a skin is against the shipped cylinder: lengths go as sqrt(R t), forces as E t^2.
struct SkinUnits {
  double length = 1, force = 1;
};
SkinUnits UnitsOf(const LinkModel& model);

/// A point of a path where the truth is recorded.
struct PressStage {
  double depth_mm = 0;  ///< of every body, from where it touches the undeformed skin
  double drag_mm = 0;
};

/// Bodies that are pressed into a skin under constant pressure and weight, stage by stage. Every stage is a
/// scene; a path without bodies is one too.
struct PressPath {
  std::string name;  ///< "<kind>-<model>-<pressure>kPa", of a skin with weight "...-<attitude>"
  PressKind kind = PressKind::kRest;
  std::string model;
  double pressure_mpa = 0;
  std::string attitude = {};  ///< in which the skin is held; empty: it is weightless
  /// Gravity less acceleration, link frame; of the slack baseline, from which markers are measured.
  Vec3 specific_force_mps2 = Vec3::Zero(), baseline_specific_force_mps2 = Vec3::Zero();
  std::vector<PressBody> bodies;
  std::vector<PressStage> stages;

  int scenes() const { return bodies.empty() ? 1 : static_cast<int>(stages.size()); }
};

/// Every kind at every pressure, MPa, without weight; of a model with a density, some of them with weight,
/// too. Depends on nothing else.
std::vector<PressPath> PressPaths(const LinkModel& model, const std::vector<double>& pressures_mpa);
/// Bodies and depths are `unit` times those of the shipped cylinder.
PressPath MakePressPath(const LinkModel& model, PressKind kind, double pressure_mpa, double unit = 1);
/// The same of a skin with weight, whose baseline was taken upright.
PressPath WithWeight(PressPath path, const std::string& attitude, const Vec3& specific_force_mps2);

}  // namespace taclink

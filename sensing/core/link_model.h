#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// R(z) of a surface of revolution, mm.
class RadiusProfile {
 public:
  static RadiusProfile Constant(double radius_mm);
  /// Circular arc through (0, end_mm), (length/2, middle_mm), (length, end_mm).
  static RadiusProfile Arc(double length_mm, double end_mm, double middle_mm);
  /// Natural cubic spline through (z, R), z strictly rising, at least two points.
  static RadiusProfile Spline(const std::vector<std::pair<double, double>>& points_mm);

  double Radius(double z_mm) const;
  double Slope(double z_mm) const;  ///< dR/dz
  /// Of a surface that is so many times as large in every direction.
  RadiusProfile Scaled(double scale) const;

 private:
  struct ConstantShape {
    double radius;
  };
  struct ArcShape {
    double center_z, center_r, arc_radius, sign;
  };
  struct SplineShape {
    std::vector<double> z, r, second_derivative;
  };
  using Shape = std::variant<ConstantShape, ArcShape, SplineShape>;
  explicit RadiusProfile(Shape shape) : shape_(std::move(shape)) {}

  Shape shape_;
};

enum class MaterialLaw : uint8_t {
  kSaintVenantKirchhoff,  ///< stress linear in Green-Lagrange strain
  kNeoHookean,            ///< incompressible: Poisson's ratio 0.5
};

/// One term of a Prony series for the stress relaxation of the skin:
/// E(t) / E(0) = 1 - sum_i share_i (1 - exp(-t / time_s_i)), t since a step of strain.
struct RelaxationTerm {
  double share = 0;   ///< of E(0) that this term loses in the end, in (0, 1)
  double time_s = 0;  ///< time constant
};

/// How the skin creeps under a constant load. The series scales all moduli alike (quasi-linear
/// viscoelasticity with one relaxation function), so it holds for any deformation.
struct Relaxation {
  std::vector<RelaxationTerm> terms;  ///< empty: the skin is elastic
  std::vector<double> share_sigmas;   ///< standard deviation of each term's share; empty: nobody measured it
  std::string source;                 ///< what it was measured from, for people

  bool any() const { return !terms.empty(); }
};

struct Material {
  /// At small strain, of a load that is applied at once: E(0) where there is a Relaxation.
  double youngs_modulus_mpa = 0;
  double poisson_ratio = 0;  ///< in [0, 0.5]; the shell is in plane stress, so 0.5 is allowed
  MaterialLaw law = MaterialLaw::kSaintVenantKirchhoff;
};

const char* Name(MaterialLaw law);  ///< as in model files

/// How well a model's Young's modulus is known.
struct MaterialEvidence {
  double sigma_mpa = 0;  ///< standard deviation
  std::string source;    ///< what it was measured from, for people
};

/// White domes on the inner wall, on `paths` x `rings`. Path l (from 1) lies at the angle
/// first_path_angle + (l - 1) 2 pi / paths from +X towards +Y, ring j (from 1) at rings_z_mm[j - 1].
struct MarkerGrid {
  int paths = 0;
  std::vector<double> rings_z_mm;  ///< rising
  double first_path_angle_rad = 0;
  double diameter_mm = 0;
  /// Where a picture shows a marker's centre: this deep below the outer surface.
  double center_depth_mm = 0;

  int rings() const { return static_cast<int>(rings_z_mm.size()); }
  int count() const { return paths * rings(); }
  double path_pitch_rad() const { return 2 * kPi / paths; }
};

/// All that is known of a type of link before it is built. Constant after it was loaded.
///
/// Link frame: origin in the centre of the clamped end at the top camera's side, +Z along the axis to the
/// other end; mm. A marker's index is (ring - 1) * paths + (path - 1), rings and paths counted from 1: ring
/// by ring, the numbering of [duong2021, (4.20)] without its clamped rings.
struct LinkModel {
  std::string name;
  std::string description;

  double length_mm = 0;      ///< between the clamped ends
  double thickness_mm = 0;   ///< of the skin
  double density_kg_m3 = 0;  ///< of the skin; 0: not known, its weight is left out
  RadiusProfile profile = RadiusProfile::Constant(1);
  double profile_depth_mm =
      0;  ///< how deep below the outer surface `profile` runs: 0 outer, t/2 middle, t inner

  Material material;
  std::optional<MaterialEvidence> material_evidence;  ///< none: nobody measured it
  Relaxation relaxation;
  MarkerGrid markers;
  double tube_outer_radius_mm = 0;  ///< the skin can't move further in; 0: no tube
  StereoRig nominal_rig;            ///< as designed; calibration starts here

  /// The point at angle and z of `profile`, moved along the normal to `depth_mm` below the outer surface.
  Vec3 PointAtDepth(double angle_rad, double z_mm, double depth_mm) const;
  /// Unit normal of the surface there, away from the axis.
  Vec3 OutwardNormal(double angle_rad, double z_mm) const;

  double PathAngle(int path_index) const {  ///< path_index from 0
    return markers.first_path_angle_rad + path_index * markers.path_pitch_rad();
  }
  int MarkerIndex(int path_index, int ring_index) const {  ///< both from 0
    return ring_index * markers.paths + path_index;
  }
  int PathOf(int marker) const { return marker % markers.paths; }  ///< from 0
  int RingOf(int marker) const { return marker / markers.paths; }  ///< from 0
  /// Force per area of the undeformed mid-surface and specific force, N/mm^2 per m/s^2, which is kg/mm^2.
  double MassPerArea() const { return 1e-9 * density_kg_m3 * thickness_mm; }
  /// Where a marker's centre is on an undeformed skin.
  Vec3 RestMarker(int marker) const;
  /// All of them, by index.
  std::vector<Vec3> RestMarkers() const;
};

}  // namespace taclink

#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"

namespace taclink {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kNoiseMm = 0.05;  ///< of a marker, across the axis

/// How a case ended.
enum class Ending {
  kRight,    ///< every check passed
  kRefused,  ///< no answer, and a reason
  kWrong,    ///< an answer that fails a check, or none without a reason
};
const char* Name(Ending ending);

struct StabilityRow {
  std::string name;
  Ending ending = Ending::kWrong;
  std::string reason;  ///< what was checked, why it was refused, or what failed
  /// Of cases that reached an equilibrium, else NaN: see TangentNumbers; work done by bodies and pressure
  /// against the stored energy, by the larger; Reciprocity.
  double condition, backward_error, float_error, energy_error, reciprocity;
};

/// A skin that gets its weight, is inflated and then pressed by a frictionless sphere of radius 10 mm.
struct SkinCase {
  std::string name;
  LinkModel model;
  double pressure_mpa = 0;
  double pressure_sigma_mpa = 0;  ///< told to the estimator
  double depth_mm = 0;            ///< from the undeformed surface; 0: no body
  /// Gravity less acceleration, link frame; the live path's baseline is upright. Zero: weightless.
  Vec3 specific_force_mps2 = Vec3::Zero();
  /// The same skin of another stiffness under loads scaled alike: must move alike.
  double reference_modulus_mpa = 0;  ///< 0: none
};

/// Names of a state's reasons, separated by commas.
std::string ReasonsOf(const LinkState& state);

/// The shipped geometry with another modulus, thickness (same mid-surface), Poisson's ratio or law. A
/// neo-Hookean skin has Poisson's ratio 0.5.
LinkModel VariedModel(const LinkModel& base, double modulus_mpa, double thickness_by_radius, double poisson,
                      MaterialLaw law);
/// The pressure that strains a skin as `pressure_kpa` strains the shipped one (E = 0.1 MPa).
double ScaledPressureMpa(const LinkModel& base, const LinkModel& model, double pressure_kpa);

std::vector<SkinCase> SkinCases(const LinkModel& base);
/// Every shipped model and the cylinder of other materials, slack, inflated, in suction and over-pressure;
/// some of them lying, tilted and upside down, with their weight.
std::vector<SkinCase> LiveCases(const LinkModel& base);
/// What links do with such a skin: markers of the forward solver with noise, untouched and under bodies as
/// large as the skin asks for, shown to the estimator by itself; what is not right must be told. A row for
/// each body; of a skin with weight another, where it is turned.
std::vector<StabilityRow> RunLiveCase(const SkinCase& skin_case);
/// Every shipped model, and the cylinder of a soft and of a stiff material.
std::vector<SkinCase> PictureCases(const LinkModel& base);
/// The whole way: pictures of such a skin that is inflated and pressed by a disc, good ones and poor ones by
/// cameras that sit elsewhere than the model says, through a link's rest labels, calibration, tracker,
/// estimator and judge. A row for each kind of pictures.
std::vector<StabilityRow> RunPictureCase(const SkinCase& skin_case);
/// `refinement` of the mesh.
StabilityRow RunSkinCase(const SkinCase& skin_case, int refinement);

/// NaN, infinities and missing markers for the estimators; NaN and impossible loads for the forward solver.
std::vector<StabilityRow> RunInputCases(const LinkModel& base,
                                        const std::function<void(const StabilityRow&)>& done);

}  // namespace taclink

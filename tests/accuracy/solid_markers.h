#pragma once

#include <array>

#include "sensing/pipeline/marker_solve.h"
#include "tests/accuracy/accuracy_row.h"

namespace taclink {

/// Whether the specific force is measured, with a standard deviation of 0.2 m/s^2.
enum class AttitudeMeasured { kAlways, kOfBaseline, kNever };

/// What is done to a solid's exact marker displacements before they are solved.
struct MarkerCondition {
  const char* name;
  double noise_mm = 0;                                    ///< of each coordinate
  double missing = 0;                                     ///< share of the markers
  double pressure_error_pa = 0;                           ///< measured minus true
  int wrong = 0;                                          ///< markers that are elsewhere, by up to 10 mm
  AttitudeMeasured attitude = AttitudeMeasured::kAlways;  ///< of solids with weight
};
inline constexpr std::array<MarkerCondition, 6> kMarkerConditions = {{{"exact"},
                                                                      {"noise", 0.1},
                                                                      {"missing", 0, 0.2},
                                                                      {"noise and missing", 0.1, 0.2},
                                                                      {"pressure 100 Pa off", 0.1, 0, 100},
                                                                      {"three wrong", 0.1, 0, 0, 3}}};

/// The same noise for the same scene and condition on every machine.
struct MarkerInput {
  SkinShape shape;
  LoadsPair loads;
};
MarkerInput MakeMarkerInput(const SolidScene& scene, const MarkerCondition& condition);

/// `estimator` is of SolidSkin().
AccuracyRow SolveSolidMarkers(const SolidScene& scene, const MarkerCondition& condition,
                              StateEstimator& estimator);

}  // namespace taclink

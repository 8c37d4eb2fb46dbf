#pragma once

#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/identification/material_fit.h"
#include "sensing/shell/skin_push.h"

namespace taclink::command {

/// One place of the skin at one pressure.
struct StiffnessRow {
  int path = 1, ring = 1;  ///< from 1
  double z_mm = 0;
  double pressure_kpa = 0;
  Result<SkinStiffness> stiffness = SkinStiffness{};  ///< error: why there is none
};

struct StiffnessReport {
  std::string model;
  double indentation_mm = 0;
  double disc_diameter_mm = 0;
  bool is_one_path = false;        ///< the other paths are alike by symmetry
  std::vector<StiffnessRow> rows;  ///< by pressure, then by place
};

void PrintStiffness(const StiffnessReport& report);
std::string StiffnessJson(const StiffnessReport& report);
/// Columns path, ring, z_mm, pressure_kpa, inflation_mm, depth_mm, force_n, secant_n_per_mm, onset_n_per_mm
/// and problem.
std::string StiffnessCsv(const StiffnessReport& report);
/// Stiffness against pressure, a curve for each place.
std::string StiffnessSvg(const StiffnessReport& report);

/// A measured force and what the model computes for the same push.
struct ComparedRow {
  ProbeRecord measured;
  double computed_n = 0;

  /// Computed less measured, of the measured force; not finite where that is zero.
  double error() const { return computed_n / measured.force_n - 1; }
};

/// Mean of |error| over the rows under pressure (above zero) whose measured force is not zero.
struct ComparisonMean {
  int rows = 0;
  double error = 0;
};
ComparisonMean MeanUnderPressure(const std::vector<ComparedRow>& rows);

void PrintComparison(const std::vector<ComparedRow>& rows);
std::string ComparisonJson(const std::string& model, const std::vector<ComparedRow>& rows);
std::string ComparisonCsv(const std::vector<ComparedRow>& rows);

}  // namespace taclink::command

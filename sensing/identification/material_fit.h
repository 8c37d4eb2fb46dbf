#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/core/skin_shape.h"

namespace taclink {

/// Markers of an untouched skin under a known pressure.
struct InflationRecord {
  std::string name{};       ///< for messages: a file
  double pressure_mpa = 0;  ///< gauge, 0 or more
  /// By marker, from rest without pressure; no information: not seen.
  std::vector<MeasuredDisplacement> markers{};
};

/// Force on a flat disc that was pressed radially against a marker.
struct ProbeRecord {
  std::string name{};       ///< for messages: file and line
  int ring = 0;             ///< of the marker, from 0
  double depth_mm = 0;      ///< of the disc, from the uninflated radius
  double pressure_mpa = 0;  ///< gauge, 0 or more
  double force_n = 0;
  double diameter_mm = 5.5;
};

struct MaterialFitOptions {
  int refinement = 3;  ///< elements per interval of the marker grid
  /// Standard deviation of a probe's force: this, and this share of it. Weights the rows against each other.
  double force_sigma_n = 0.01;
  double force_sigma_share = 0.05;
  /// Called after each nonlinear solution, with their number so far.
  std::function<void(int)> progress{};
};

/// One inflation record against the common fit.
struct InflationFit {
  std::string name{};
  double pressure_mpa = 0;
  int used = 0;            ///< markers
  int outliers = 0;        ///< markers that were left out
  double measured_mm = 0;  ///< RMS of the used markers' displacements
  double rmse_mm = 0;      ///< RMS of what the model leaves of them
  /// Of this record alone, to first order about the common fit, and its standard deviation.
  double youngs_modulus_mpa = 0, sigma_mpa = 0;
};

/// One probe row against the common fit.
struct ProbeFit {
  std::string name{};
  bool used = true;  ///< false: contradicts the others, left out
  double measured_n = 0, model_n = 0;
};

/// What one kind of records says alone.
struct KindFit {
  double youngs_modulus_mpa = 0;
  double sigma_mpa = 0;
  int values = 0;   ///< numbers that were fitted
  double chi2 = 0;  ///< against the stated standard deviations
  /// RMS of residuals over RMS of the measured values, both weighted; of the common fit, not of this one.
  double misfit = 0;
};

/// Young's modulus of one law. It is the modulus with which *this* shell does what the skin did: what the
/// shell leaves out, and errors of the model's thickness and of the pressure, are in it and not in its
/// standard deviation.
struct MaterialFit {
  Material material;
  /// From the scatter of the residuals and the derivative, of independent errors but for one rest
  /// shape that all inflation records share, and 0.1 % of the mesh. More where records, or inflation and
  /// forces, contradict each other by more than that.
  double sigma_mpa = 0;
  std::optional<KindFit> inflation, probe;
  /// Inflation's modulus against the forces', in standard deviations; 0 with one kind.
  double tension = 0;
  double misfit = 0;  ///< RMS of the kinds'
  std::vector<InflationFit> inflations;
  std::vector<ProbeFit> probes;
};

/// Fits Young's modulus for a law by least squares, in its logarithm, to all records: [duong2021, (5.42)],
/// with the nonlinear shell. What contradicts most others is left out. Where inflation and forces disagree
/// each weighs by its standard deviation and half the disagreement (random effects [dersimonian1986]).
/// Errors: kInvalidArgument, kFailedPrecondition; say which record, and why it can't serve: no pressure, too
/// few markers, touched while inflating, residuals too large, nothing told of the modulus, a modulus outside
/// 1e-4 .. 1e5 MPa.
Result<MaterialFit> FitMaterial(const LinkModel& model, MaterialLaw law,
                                std::span<const InflationRecord> inflations,
                                std::span<const ProbeRecord> probes, const MaterialFitOptions& options = {});

}  // namespace taclink

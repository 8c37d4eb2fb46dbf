#pragma once

#include <algorithm>
#include <functional>
#include <span>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/identification/material_fit.h"
#include "sensing/shell/skin_response.h"

namespace taclink {

/// A marker, or a probe's force, against the model at some Young's modulus E; whitened: errors have standard
/// deviation 1 in `dims` directions and all else is 0.
struct Observation {
  int record = 0;
  int marker = -1;  ///< -1: a force
  int dims = 0;
  Vec3 measured = Vec3::Zero(), model = Vec3::Zero();
  Vec3 by_log = Vec3::Zero();  ///< of the model, by ln E

  Vec3 residual() const { return measured - model; }
};
using Observations = std::vector<Observation>;

/// The records of one kind, seen at a modulus. Observations come in the same order every time.
using EvidenceAt = std::function<Result<Observations>(double youngs_modulus_mpa)>;
EvidenceAt InflationEvidence(const LinkModel& model, SkinResponse& response,
                             std::span<const InflationRecord> records);
EvidenceAt ProbeEvidence(SkinResponse& response, std::span<const ProbeRecord> records,
                         const MaterialFitOptions& options);

/// To begin with, from small displacements: [duong2021, (5.45)], the median over the markers; of forces least
/// squares. Not positive: the records contradict the model.
Result<double> LinearModulus(const LinkModel& model, SkinResponse& response,
                             std::span<const InflationRecord> records);
Result<double> LinearModulus(SkinResponse& response, std::span<const ProbeRecord> records,
                             const MaterialFitOptions& options);

/// Those not to be used: far larger residuals than most of their record. By observation.
std::vector<bool> OutliersOf(const Observations& observations);

/// Sums over those used.
struct EvidenceSums {
  int values = 0;
  double chi2 = 0, measured2 = 0;
  double curvature = 0;  ///< sum of squared derivatives
  double gradient = 0;   ///< sum of derivative times residual
  /// Of the residuals against the stated standard deviations; 1 at least where there are hardly any.
  double variance() const { return values > 3 ? chi2 / (values - 1) : std::max(1.0, chi2); }
};
EvidenceSums Sum(const Observations& observations, const std::vector<bool>& outliers, int record = -1);

/// What can be refused before any solution.
Result<void> CheckRecords(const LinkModel& model, std::span<const InflationRecord> inflations,
                          std::span<const ProbeRecord> probes, const MaterialFitOptions& options);
/// Refuses a record in which neighbours stay behind together, or too many markers are outliers. `seen` at
/// `modulus`, MPa.
Result<void> CheckUntouched(const LinkModel& model, SkinResponse& response,
                            std::span<const InflationRecord> records, const Observations& seen,
                            const std::vector<bool>& outliers, double modulus);

/// Where a function of one variable is least, walking downhill from `start`. Infinite: not defined there.
struct Minimum {
  double at = 0, value = 0;
  bool at_edge = false;  ///< it may be lower where the function is not defined
};
Minimum Minimise(const std::function<double(double)>& cost, double start);  // [press2007, section 10.2]

}  // namespace taclink

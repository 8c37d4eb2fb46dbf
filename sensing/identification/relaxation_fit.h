#pragma once

#include <span>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink {

/// Forces of a body that pressed the skin, was held and was removed, once or more often. The skin was relaxed
/// before the first sample.
struct RelaxationRecord {
  struct Sample {
    double time_s = 0;
    double apparent_n = 0;   ///< estimated from the skin's shape by a model without Relaxation
    double reference_n = 0;  ///< from a force sensor or a weight
  };
  std::string name{};  ///< for messages, such as a file name
  std::vector<Sample> samples{};
};

/// Fits the Prony series of a creeping skin to records of loads that were held and removed. The apparent
/// force is the reference force after creep (RelaxationFilter), times a gain of each record (an error of
/// modulus or place is not creep). Least squares with the gains eliminated (variable projection [golub1973]),
/// by the Levenberg-Marquardt method from a grid of time constants; a second term only if it improves
/// Schwarz' criterion [schwarz1978] by 10. The shares' standard deviations are marginal over all fitted
/// parameters, for residuals of equal variance with the estimated correlation of successive samples.
///
/// `Relaxation::terms` are in the order of time. Errors: kInvalidArgument (a record with numbers that are not
/// finite, times that do not rise, no positive force or a single sample; fewer than 20 samples),
/// kFailedPrecondition (creep is not distinguishable from noise, or the records do not determine the series;
/// the message says what to record instead).
Result<Relaxation> FitRelaxation(std::span<const RelaxationRecord> records);

}  // namespace taclink

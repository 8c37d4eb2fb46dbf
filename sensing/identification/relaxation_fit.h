#pragma once

#include <span>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink {

/// A body that pressed the skin, was held and was taken off again, as often as it may be; the skin had rested
/// before the first sample.
struct RelaxationRecord {
  struct Sample {
    double time_s = 0;
    double apparent_n = 0;   ///< as a model without Relaxation estimates it from the skin's shape
    double reference_n = 0;  ///< as a force sensor, or a weight, has it
  };
  std::string name{};  ///< for messages: a file
  std::vector<Sample> samples{};
};

/// Fits the Prony series with which a skin creeps to records of loads that were held and removed: the
/// apparent force is the reference's, as RelaxationFilter has it creep, times a gain of each record (an error
/// of the modulus, or of the place, is no creep). Least squares with the gains eliminated (variable
/// projection [golub1973]), by Levenberg's and Marquardt's method from a grid of time constants; a second
/// term only where it improves Schwarz' criterion [schwarz1978] by 10. Standard deviations are those of the
/// shares beside everything else that was fitted, of residuals that are alike and correlated from sample to
/// sample as they are found to be.
///
/// `Relaxation::terms` rise in time. Errors: kInvalidArgument (a record whose numbers are not finite, whose
/// times do not rise or that never presses; fewer than 20 samples), kFailedPrecondition (no creep that is
/// told from noise, or the series is not determined by these records: what to record instead).
Result<Relaxation> FitRelaxation(std::span<const RelaxationRecord> records);

}  // namespace taclink

#pragma once

#include <string>

#include "sensing/acceptance/acceptance.h"
#include "sensing/acceptance/statistics.h"

namespace taclink {

/// Relative change of the measured force from the first samples of a held load to its last. The load is
/// constant, so any change comes from the link. One or two holds do not show the scatter between holds: the
/// noise within them is used instead.
struct HeldLoads {
  Estimate change;  ///< samples: the holds
};
HeldLoads AnalyzeHolds(const AcceptanceRecord& record);

/// The relaxation fitted to the holds (FitRelaxation), as text for the model file, with a comma before it;
/// empty: the holds do not determine it.
std::string FittedRelaxation(const AcceptanceRecord& record);

}  // namespace taclink

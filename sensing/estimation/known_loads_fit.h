#pragma once

#include <Eigen/Core>

#include "sensing/core/known_loads.h"
#include "sensing/estimation/assimilation.h"
#include "sensing/estimation/skin_mechanics.h"
#include "sensing/estimation/untouched_covariance.h"

namespace taclink {

/// The known loads under which the untouched skin is nearest to the markers: Gauss-Newton on a robust sum of
/// residuals (Huber's, iteratively reweighted [huber1981]) with the prior of the loads, since contacts move
/// some markers far. A place to linearize at, not an estimate: it does not see contacts.
///
/// `measured`, `errors`: the prior. `baseline_mm`: stacked, from the slack skin, from which the observed
/// displacements count. Errors that move no marker far are not fitted; where all
/// are such, `measured` comes back.
KnownLoads FitKnownLoads(SkinMechanics& mechanics, const MarkerObservations& observed,
                         const Eigen::VectorXd& baseline_mm, const KnownLoads& measured,
                         const KnownLoadsErrors& errors);

}  // namespace taclink

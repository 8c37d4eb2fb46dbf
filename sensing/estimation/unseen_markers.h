#pragma once

#include "sensing/core/link_model.h"
#include "sensing/estimation/assimilation.h"

namespace taclink {

/// Gives every marker that is not seen the displacement, beyond `without_loads_mm`, of those around it: the
/// discrete harmonic function that takes the seen markers' values, turned with the markers about the axis.
/// Its standard deviation is 0.35 mm per marker to the nearest seen one. Without it a search for the skin's
/// shape may leave what nobody sees where it was, and find another equilibrium, with a bulge there.
/// `without_loads_mm`: all markers', stacked; `unit`: SkinMechanics::length_unit().
void InterpolateUnseen(const LinkModel& model, const Eigen::VectorXd& without_loads_mm, double unit,
                       MarkerObservations& observed);

}  // namespace taclink

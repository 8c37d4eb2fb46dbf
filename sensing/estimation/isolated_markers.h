#pragma once

#include "sensing/core/link_model.h"
#include "sensing/estimation/assimilation.h"

namespace taclink {

/// No skin has markers so isolated: of 149 solids under contacts of all kinds one comes to 0.71. The second
/// finds more wrong ones among those of a contact, and some that are right.
constexpr double kSurelyIsolated = 0.8, kPerhapsIsolated = 0.35;

/// Markers that are somewhere else than all markers around them: farther from the nearest of those than
/// `most` times what these are from each other and from where the skin has the marker without loads. They are
/// taken for wrong and lose their information. Of two wrong ones side by side neither is found.
/// `without_loads_mm`: all markers', stacked; `unit`: SkinMechanics::length_unit(). Returns how many were
/// hidden.
int HideIsolated(const LinkModel& model, const Eigen::VectorXd& without_loads_mm, double most, double unit,
                 MarkerObservations& observed);

}  // namespace taclink

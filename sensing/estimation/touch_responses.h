#pragma once

#include <Eigen/Core>
#include <optional>

#include "sensing/core/known_loads.h"
#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// Displacements of all markers (stacked, mm) by an inward normal force of 1 N at each marker (one column for
/// each), to first order about the untouched skin under these loads. The force is spread as
/// SkinMechanics::spread. Takes some hundredths of a second, a skin that sags by its weight longer. nullopt:
/// there is no such skin.
std::optional<Eigen::MatrixXf> TouchResponses(SkinMechanics& mechanics, const KnownLoads& loads);

}  // namespace taclink

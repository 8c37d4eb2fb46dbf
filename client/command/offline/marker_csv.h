#pragma once

#include <optional>
#include <string>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/core/skin_shape.h"

namespace taclink::command {

/// Reads marker displacements: columns `path,ring,ux,uy,uz` (from 1; mm, link frame), a header line first,
/// rows in any order. Markers that are left out or have empty displacements are kInferred and not displaced;
/// see InferUnseen. `sigma_mm`: standard deviation of ux and uy; uz's is three times that; none: NoiseOf what
/// is read. Errors: kNotFound, kInvalidArgument with file and line.
Result<SkinShape> ReadMarkerCsv(const std::string& path, const LinkModel& model,
                                std::optional<double> sigma_mm);

}  // namespace taclink::command

#pragma once

#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/identification/material_fit.h"

namespace taclink::command {

/// Reads forces on a disc that was pressed radially against markers: a header line, then rows. Columns, in
/// any order: `ring` or `j` (from 1), depth_mm (from the uninflated radius), pressure_kpa, force_n; others
/// are passed over. Records are named after file and line. Errors: kNotFound, kInvalidArgument with file and
/// line.
Result<std::vector<ProbeRecord>> ReadProbeCsv(const std::string& path, const LinkModel& model,
                                              double diameter_mm);

}  // namespace taclink::command

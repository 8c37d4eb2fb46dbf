#pragma once

#include "sensing/pipeline/judge.h"

namespace taclink {

/// How far a marker has gone toward the axis from the untouched skin, mm; 0: not known.
double DentAt(const Evidence& evidence, int marker);

/// Adds that a part of one camera's view is obstructed.
void AddObstructionReason(const Evidence& evidence, LinkState& state);

/// Adds what the markers that are in sight leave open: contacts beyond the outer rings, labels that were left
/// out, stretches without markers.
void AddSightReasons(const Evidence& evidence, LinkState& state);

}  // namespace taclink

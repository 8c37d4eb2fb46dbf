#pragma once

#include "sensing/core/geometry.h"

namespace taclink {

/// A marker's covariance by what cameras say of it, mm^2. `information`: 1/mm^2, symmetric; a direction of
/// less than 1 / unseen_mm^2, or an information that is not finite, counts as that.
Mat3 NoiseOf(const Mat3& information, double unseen_mm);
/// The trace of that.
double NoiseTraceOf(const Mat3& information, double unseen_mm);
/// Whether no direction has less than `least` of the information, 1/mm^2. Quick: false may be wrong.
bool IsSurelySeen(const Mat3& information, double least);

}  // namespace taclink

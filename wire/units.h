#pragma once

namespace taclink::wire {

// mm, N, MPa, ms inside; m, N, Pa, s on the wire.
inline constexpr double kMetresPerMm = 1e-3;
inline constexpr double kSquareMetresPerMm2 = 1e-6;
inline constexpr double kPascalsPerMpa = 1e6;
inline constexpr double kSecondsPerMs = 1e-3;

}  // namespace taclink::wire

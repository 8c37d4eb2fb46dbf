#pragma once

namespace taclink::command {

// The API speaks SI; people read mm and kPa.
inline constexpr double kMmPerMetre = 1e3;
inline constexpr double kMm2PerSquareMetre = 1e6;
inline constexpr double kKpaPerPascal = 1e-3;

}  // namespace taclink::command

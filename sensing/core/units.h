#pragma once

namespace taclink {

// People give pressures in kPa; sensing has MPa.
inline constexpr double kMpaPerKpa = 1e-3;

}  // namespace taclink

#pragma once

#include <cstdint>

namespace taclink {

inline constexpr int64_t kMs = 1'000'000;  ///< ns

}  // namespace taclink

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace taclink {

/// How much of a frame is sent; each level holds all of the level before (taclink.v1.Detail).
enum class Detail : uint8_t { kContacts, kGeometry, kFull };
inline constexpr size_t kDetailCount = 3;
inline constexpr std::array<Detail, kDetailCount> kAllDetails = {Detail::kContacts, Detail::kGeometry,
                                                                 Detail::kFull};

constexpr size_t Index(Detail detail) {
  return static_cast<size_t>(detail);
}

}  // namespace taclink

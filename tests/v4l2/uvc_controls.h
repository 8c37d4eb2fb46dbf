#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace taclink::testing {

/// What an emulated camera can be set to, as when it is plugged in.
struct UvcSettings {
  uint32_t exposure_mode = 8;  ///< UVC's bits: 1 manual, 8 aperture priority
  uint32_t exposure_100us = 156;
  uint32_t gain = 16;

  bool operator==(const UvcSettings&) const = default;
};
inline constexpr uint32_t kUvcLongest100us = 5000, kUvcLargestGain = 64;

/// A control request of UVC 1.0, 4.2.2.
struct UvcControl {
  uint8_t code = 0, selector = 0, unit = 0;
};
/// None: there is no such control.
std::optional<std::vector<uint8_t>> ReadControl(const UvcSettings& settings, const UvcControl& control);
/// False: there is no such control, or it can't be so.
bool WriteControl(const UvcControl& control, std::span<const uint8_t> data, UvcSettings& settings);

}  // namespace taclink::testing

#include "tests/v4l2/uvc_controls.h"

#include "tests/v4l2/uvc_descriptors.h"

namespace taclink::testing {
namespace {

enum : uint8_t { kGetCurrent = 0x81, kGetMin = 0x82, kGetMax = 0x83, kGetRes = 0x84 };
enum : uint8_t { kGetControlInfo = 0x86, kGetDefault = 0x87 };
constexpr uint8_t kGetAndSet = 3;
constexpr uint32_t kModes = 1 | 8;  // manual and aperture priority

struct Control {
  uint8_t unit = 0, selector = 0;
  size_t bytes = 0;
  uint32_t UvcSettings::* value = nullptr;
  uint32_t min = 0, max = 0, step = 0;
};
constexpr Control kControls[] = {
    {kUvcCamera, 2, 1, &UvcSettings::exposure_mode, 0, kModes, kModes},  // its step is the set of modes
    {kUvcCamera, 4, 4, &UvcSettings::exposure_100us, 1, kUvcLongest100us, 1},
    {kUvcProcessing, 4, 2, &UvcSettings::gain, 0, kUvcLargestGain, 1},
};

const Control* Find(const UvcControl& wanted) {
  for (const Control& each : kControls)
    if (each.unit == wanted.unit && each.selector == wanted.selector) return &each;
  return nullptr;
}

std::vector<uint8_t> LittleEndian(uint32_t value, size_t bytes) {
  std::vector<uint8_t> out(bytes);
  for (size_t i = 0; i < bytes; ++i) out[i] = static_cast<uint8_t>(value >> (8 * i));
  return out;
}

}  // namespace

std::optional<std::vector<uint8_t>> ReadControl(const UvcSettings& settings, const UvcControl& control) {
  const Control* const found = Find(control);
  if (!found) return std::nullopt;
  switch (control.code) {
    case kGetCurrent:
      return LittleEndian(settings.*found->value, found->bytes);
    case kGetMin:
      return LittleEndian(found->min, found->bytes);
    case kGetMax:
      return LittleEndian(found->max, found->bytes);
    case kGetRes:
      return LittleEndian(found->step, found->bytes);
    case kGetDefault:
      return LittleEndian(UvcSettings().*found->value, found->bytes);
    case kGetControlInfo:
      return LittleEndian(kGetAndSet, 1);
    default:
      return std::nullopt;
  }
}

bool WriteControl(const UvcControl& control, std::span<const uint8_t> data, UvcSettings& settings) {
  const Control* const found = Find(control);
  if (!found || data.size() < found->bytes) return false;
  uint32_t value = 0;
  for (size_t i = 0; i < found->bytes; ++i) value |= uint32_t{data[i]} << (8 * i);
  if (value < found->min || value > found->max) return false;
  settings.*found->value = value;
  return true;
}

}  // namespace taclink::testing

#include "tests/v4l2/uvc_descriptors.h"

#include <algorithm>
#include <initializer_list>

namespace taclink::testing {
namespace {

using Bytes = std::vector<uint8_t>;

// Descriptor types and subtypes, from the USB 2.0 and UVC 1.0 specifications.
constexpr uint8_t kDevice = 1, kConfiguration = 2, kString = 3, kInterface = 4, kEndpoint = 5,
                  kAssociation = 11, kClass = 0x24;
constexpr uint8_t kVideo = 14, kVideoControl = 1, kVideoStreaming = 2, kVideoCollection = 3;
constexpr uint8_t kControlHeader = 1, kInputTerminal = 2, kOutputTerminal = 3, kProcessingUnit = 5;
// What can be set: exposure mode and time of the camera, gain of its processing unit.
constexpr uint8_t kExposureControls = 0x0a, kGainControl = 0x02;
constexpr uint8_t kInputHeader = 1, kFormatYuv = 4, kFrameYuv = 5, kFormatMjpeg = 6, kFrameMjpeg = 7,
                  kColors = 13;

void Put16(Bytes& out, uint32_t value) {
  out.push_back(static_cast<uint8_t>(value));
  out.push_back(static_cast<uint8_t>(value >> 8));
}
void Put32(Bytes& out, uint32_t value) {
  Put16(out, value);
  Put16(out, value >> 16);
}
void Append(Bytes& out, const Bytes& more) {
  out.insert(out.end(), more.begin(), more.end());
}
/// With its length before it.
Bytes Sized(Bytes body) {
  body.insert(body.begin(), static_cast<uint8_t>(body.size() + 1));
  return body;
}
void SetTotal(Bytes& descriptors, size_t at, size_t total) {
  descriptors[at] = static_cast<uint8_t>(total);
  descriptors[at + 1] = static_cast<uint8_t>(total >> 8);
}

Bytes Interface(uint8_t number, uint8_t endpoints, uint8_t subclass) {
  return Sized({kInterface, number, 0, endpoints, kVideo, subclass, 0, 0});
}

Bytes ControlInterface() {
  Bytes out = Sized({kClass, kControlHeader, 0x00, 0x01, 0, 0, 0x00, 0x6c, 0xdc, 0x02, 1, 1});
  Append(out, Sized({kClass, kInputTerminal, kUvcCamera, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 3,
                     kExposureControls, 0, 0}));
  Append(out, Sized({kClass, kProcessingUnit, kUvcProcessing, kUvcCamera, 0, 0, 2, 0, kGainControl, 0}));
  Append(out, Sized({kClass, kOutputTerminal, 2, 0x01, 0x01, 0, kUvcProcessing, 0}));  // to USB
  SetTotal(out, 5, out.size());
  return out;
}

Bytes Frame(uint8_t type, uint8_t index, const UvcSize& size) {
  Bytes out = {kClass, type, index, 0};
  Put16(out, static_cast<uint32_t>(size.width_px));
  Put16(out, static_cast<uint32_t>(size.height_px));
  const uint32_t bits = UvcPictureBytes(size) * 8;
  Put32(out, bits * static_cast<uint32_t>(size.rates_hz.back()));
  Put32(out, bits * static_cast<uint32_t>(size.rates_hz.front()));
  Put32(out, UvcPictureBytes(size));
  Put32(out, UvcInterval100ns(size.rates_hz.front()));
  out.push_back(static_cast<uint8_t>(size.rates_hz.size()));
  for (const int rate : size.rates_hz) Put32(out, UvcInterval100ns(rate));
  return Sized(out);
}

Bytes Format(const Bytes& description, uint8_t frame_type) {
  Bytes out = Sized(description);
  for (size_t i = 0; i < kUvcSizes.size(); ++i)
    Append(out, Frame(frame_type, static_cast<uint8_t>(i + 1), kUvcSizes[i]));
  Append(out, Sized({kClass, kColors, 1, 1, 4}));
  return out;
}

Bytes StreamingInterface() {
  Bytes out = Sized({kClass, kInputHeader, 2, 0, 0, 0x80 | kUvcEndpoint, 0, 2, 0, 0, 0, 1, 0, 0});
  const auto frames = static_cast<uint8_t>(kUvcSizes.size());
  Append(out, Format({kClass, kFormatMjpeg, kUvcMjpeg, frames, 0, 1, 0, 0, 0, 0}, kFrameMjpeg));
  // The GUID of YUY2.
  Append(out, Format({kClass, kFormatYuv, kUvcYuyv, frames, 'Y',  'U',  'Y',  '2', 0, 0, 0x10, 0, 0x80,
                      0,      0,          0xaa,     0,      0x38, 0x9b, 0x71, 16,  1, 0, 0,    0, 0},
                     kFrameYuv));
  SetTotal(out, 4, out.size());
  return out;
}

}  // namespace

uint32_t UvcInterval100ns(int rate_hz) {
  return 10'000'000u / static_cast<uint32_t>(rate_hz);
}

uint32_t UvcPictureBytes(const UvcSize& size) {
  return static_cast<uint32_t>(size.width_px * size.height_px * 2);
}

std::vector<uint8_t> DeviceDescriptor() {
  return Sized({kDevice, 0x00, 0x02, 0xef, 2, 1, 64, 0x6b, 0x1d, 0x02, 0x01, 0x00, 0x01, 1, 2, 3, 1});
}

std::vector<uint8_t> ConfigurationDescriptor() {
  Bytes out = Sized({kConfiguration, 0, 0, 2, 1, 0, 0x80, 250});
  Append(out, Sized({kAssociation, 0, 2, kVideo, kVideoCollection, 0, 0}));
  Append(out, Interface(0, 0, kVideoControl));
  Append(out, ControlInterface());
  Append(out, Interface(1, 1, kVideoStreaming));
  Append(out, StreamingInterface());
  Append(out, Sized({kEndpoint, 0x80 | kUvcEndpoint, 2, 0x00, 0x02, 0}));  // bulk, 512 bytes
  SetTotal(out, 2, out.size());
  return out;
}

std::vector<uint8_t> StringDescriptor(uint8_t index, const std::string& serial) {
  if (index == 0) return {4, kString, 0x09, 0x04};  // American English
  const std::string text = index == 1 ? "TacLINK tests" : index == 2 ? "Emulated camera" : serial;
  Bytes out = {kString};
  for (const char letter : text) Put16(out, static_cast<uint8_t>(letter));
  return Sized(out);
}

}  // namespace taclink::testing

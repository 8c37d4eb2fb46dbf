#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace taclink::testing {

/// What an emulated camera offers: of each format every size, of each size every rate.
struct UvcSize {
  int width_px = 640;
  int height_px = 480;
  std::vector<int> rates_hz;
};
inline const std::vector<UvcSize> kUvcSizes = {{640, 480, {30, 15, 10, 5, 4, 3, 2}},
                                               {320, 240, {120, 60, 30, 5}}};
/// Format indices of the device, from 1.
inline constexpr uint8_t kUvcMjpeg = 1, kUvcYuyv = 2;
inline constexpr uint32_t kUvcMaxPayload = 16384;
inline constexpr uint8_t kUvcEndpoint = 1;
/// Numbers of the camera terminal and the processing unit.
inline constexpr uint8_t kUvcCamera = 1, kUvcProcessing = 3;

uint32_t UvcInterval100ns(int rate_hz);
uint32_t UvcPictureBytes(const UvcSize& size);

/// Descriptors of USB 2.0, chapter 9, and of UVC 1.0 with one bulk endpoint.
std::vector<uint8_t> DeviceDescriptor();
std::vector<uint8_t> ConfigurationDescriptor();
/// 0: the languages; 1: maker; 2: product; 3: serial number.
std::vector<uint8_t> StringDescriptor(uint8_t index, const std::string& serial);

}  // namespace taclink::testing

#include "sensing/capture/camera_device.h"

#include <utility>

#include "sensing/core/thread_start.h"

namespace taclink {

std::future<OpenedCamera> OpenDetached(std::unique_ptr<CameraDevice> old,
                                       std::function<OpenedCamera()> open) {
  auto opening = RunDetached("camera-open", [old = std::move(old), open = std::move(open)]() mutable {
    old.reset();
    return open();
  });
  if (opening) return *std::move(opening);
  std::promise<OpenedCamera> refused;
  refused.set_value(opening.error());
  return refused.get_future();
}

void CopyPicture(std::span<const uint8_t> bytes, const CameraFormat& format, RawImage& image) {
  const auto line = static_cast<size_t>(format.width_px) * (format.pixels == PixelFormat::kYuyv ? 2 : 1);
  const auto stride = static_cast<size_t>(format.bytes_per_line);
  image.format = format.pixels;
  image.width_px = format.width_px;
  image.height_px = format.height_px;
  if (stride == 0 || stride == line) {
    image.bytes.assign(bytes.begin(), bytes.end());
    return;
  }
  image.bytes.clear();
  for (size_t start = 0; start + line <= bytes.size(); start += stride) {
    const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(start);
    image.bytes.insert(image.bytes.end(), from, from + static_cast<std::ptrdiff_t>(line));
  }
}

}  // namespace taclink

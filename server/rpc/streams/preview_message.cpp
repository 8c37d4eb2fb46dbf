#include "server/rpc/streams/preview_message.h"

namespace taclink::server {
namespace {

constexpr int kQuality = 80;

}  // namespace

void PreviewMaker::Fill(const RawImage& image, CameraId camera, v1::PreviewPicture& out) {
  out.set_camera(Name(camera));
  out.set_width_px(static_cast<uint32_t>(image.width_px));
  out.set_height_px(static_cast<uint32_t>(image.height_px));
  if (!image.valid) {
    out.set_why_missing(image.why_missing.empty() ? "the camera gave no picture" : image.why_missing);
    return;
  }
  if (image.format == PixelFormat::kMjpeg) {
    out.set_jpeg(image.bytes.data(), image.bytes.size());
    if (const auto size = JpegSize(image.bytes); image.width_px == 0 && size) {  // from a log
      out.set_width_px(static_cast<uint32_t>(size->width_px));
      out.set_height_px(static_cast<uint32_t>(size->height_px));
    }
  } else if (auto made = decoder_.Decode(image, gray_); !made) {
    out.set_why_missing(made.error().message);
  } else if (made = encoder_.Encode(gray_, kQuality, jpeg_); !made) {
    out.set_why_missing(made.error().message);
  } else {
    out.set_jpeg(jpeg_.data(), jpeg_.size());
  }
}

}  // namespace taclink::server

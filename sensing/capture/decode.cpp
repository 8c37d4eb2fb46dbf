#include "sensing/capture/decode.h"

#include <turbojpeg.h>

#include <cstring>
#include <string>
#include <string_view>

namespace taclink {
namespace {

Error Bad(const std::string& message) {
  return {ErrorCode::kInvalidArgument, message};
}

std::string SizeText(int width_px, int height_px) {
  return std::to_string(width_px) + "x" + std::to_string(height_px);
}

/// `bytes_per_pixel` of the packed source, whose luma is the first byte of each pixel.
Result<void> DecodePacked(const RawImage& image, const char* format, size_t bytes_per_pixel, cv::Mat& gray) {
  const size_t pixels = static_cast<size_t>(image.width_px) * static_cast<size_t>(image.height_px);
  const size_t needed = pixels * bytes_per_pixel;
  if (image.bytes.size() < needed) {
    return Bad("short picture: " + std::to_string(image.bytes.size()) + " bytes of " +
               std::to_string(needed) + " for " + SizeText(image.width_px, image.height_px) + " " + format);
  }
  const uint8_t* const from = image.bytes.data();
  uint8_t* const to = gray.data;
  if (bytes_per_pixel == 1) {
    std::memcpy(to, from, pixels);
  } else {
    for (size_t i = 0; i < pixels; ++i) to[i] = from[2 * i];  // the compiler makes vector code of this
  }
  return {};
}

/// Bytes too many before the end marker are common with USB cameras and harm nothing: the picture is whole by
/// then. libjpeg keeps only the first warning, so any other one comes first if there is one.
bool IsHarmless(tjhandle handle) {
  return tjGetErrorCode(handle) == TJERR_WARNING &&
         std::string_view(tjGetErrorStr2(handle)).find("extraneous bytes before marker 0xd9") !=
             std::string_view::npos;
}

struct JpegHandle {
  tjhandle handle = tjInitDecompress();

  JpegHandle() = default;
  JpegHandle(const JpegHandle&) = delete;
  JpegHandle& operator=(const JpegHandle&) = delete;
  ~JpegHandle() {
    if (handle) tjDestroy(handle);
  }

  Result<PictureSize> ReadHeader(std::span<const uint8_t> bytes) const {
    if (!handle) return Error{ErrorCode::kInternal, "TurboJPEG does not start"};
    if (bytes.empty()) return Bad("not a JPEG picture: no bytes");
    PictureSize size;
    int subsampling = 0, colorspace = 0;
    if (tjDecompressHeader3(handle, bytes.data(), bytes.size(), &size.width_px, &size.height_px, &subsampling,
                            &colorspace)) {
      return Bad("not a JPEG picture" + Why());
    }
    return size;
  }

  std::string Why() const { return std::string(": ") + tjGetErrorStr2(handle); }
};

}  // namespace

Result<PictureSize> JpegSize(std::span<const uint8_t> bytes) {
  return JpegHandle().ReadHeader(bytes);
}

struct GrayDecoder::Jpeg : JpegHandle {
  Result<void> Decode(const RawImage& image, cv::Mat& gray) {
    const auto size = ReadHeader(image.bytes);
    if (!size) return size.error();
    if (size->width_px != image.width_px || size->height_px != image.height_px) {
      return Bad("JPEG picture is " + SizeText(size->width_px, size->height_px) + ", not " +
                 SizeText(image.width_px, image.height_px));
    }
    if (tjDecompress2(handle, image.bytes.data(), image.bytes.size(), gray.data, size->width_px,
                      static_cast<int>(gray.step[0]), size->height_px, TJPF_GRAY, TJFLAG_LIMITSCANS) &&
        !IsHarmless(handle)) {
      return Bad("damaged JPEG picture" + Why());
    }
    return {};
  }
};

GrayDecoder::GrayDecoder() : jpeg_(std::make_unique<Jpeg>()) {}
GrayDecoder::~GrayDecoder() = default;
GrayDecoder::GrayDecoder(GrayDecoder&&) noexcept = default;
GrayDecoder& GrayDecoder::operator=(GrayDecoder&&) noexcept = default;

Result<void> GrayDecoder::Decode(const RawImage& image, cv::Mat& gray) {
  if (!image.valid) return Bad("no picture");
  if (image.width_px < 1 || image.height_px < 1 || image.width_px > kMaxPictureSidePx ||
      image.height_px > kMaxPictureSidePx) {
    return Bad("picture size " + SizeText(image.width_px, image.height_px) + " is not from 1x1 to " +
               SizeText(kMaxPictureSidePx, kMaxPictureSidePx));
  }
  if (!gray.isContinuous() || gray.isSubmatrix()) gray.release();
  gray.create(image.height_px, image.width_px, CV_8UC1);
  switch (image.format) {
    case PixelFormat::kGray8:
      return DecodePacked(image, "gray", 1, gray);
    case PixelFormat::kYuyv:
      return DecodePacked(image, "YUYV", 2, gray);
    case PixelFormat::kMjpeg:
      return jpeg_->Decode(image, gray);
  }
  return Error{ErrorCode::kInternal, "unknown pixel format"};
}

}  // namespace taclink

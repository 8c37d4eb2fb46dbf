#include "sensing/capture/image_io.h"

#include <png.h>
#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "sensing/capture/decode.h"
#include "sensing/core/read_file.h"

namespace taclink {
namespace {

using Bytes = std::span<const uint8_t>;

/// The largest picture, three bytes a pixel, uncompressed.
constexpr size_t kMaxFileBytes = size_t{3} * kMaxPictureSidePx * kMaxPictureSidePx;
/// Where a picture's size mostly stands, and how far behind long metadata it may stand.
constexpr std::array<size_t, 2> kHeaderBytes = {size_t{1} << 12, size_t{1} << 20};

Error BadFile(const std::string& path, const std::string& what) {
  return {ErrorCode::kInvalidArgument, path + ": " + what};
}

Bytes BytesOf(const std::string& content) {
  return {reinterpret_cast<const uint8_t*>(content.data()), content.size()};
}

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

/// libpng's simplified interface reports errors by value; this frees what it holds.
struct PngReader {
  png_image image{};

  PngReader() { image.version = PNG_IMAGE_VERSION; }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
  ~PngReader() { png_image_free(&image); }

  bool Begin(Bytes bytes) {
    return png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) != 0;
  }
  bool Finish(std::vector<uint8_t>& pixels) {
    constexpr png_color kBlack = {0, 0, 0};  // behind transparency
    return png_image_finish_read(&image, &kBlack, pixels.data(), 0, nullptr) != 0;
  }
};

bool IsPng(Bytes bytes) {
  constexpr std::array<uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  return bytes.size() >= kSignature.size() && std::equal(kSignature.begin(), kSignature.end(), bytes.begin());
}

bool IsJpeg(Bytes bytes) {
  return bytes.size() >= 3 && bytes[0] == 0xff && bytes[1] == 0xd8 && bytes[2] == 0xff;
}

Result<ImageFileInfo> Checked(const std::string& path, ImageFileInfo info) {
  if (info.width_px >= 1 && info.height_px >= 1 && info.width_px <= kMaxPictureSidePx &&
      info.height_px <= kMaxPictureSidePx) {
    return info;
  }
  return BadFile(path, "the picture is " + std::to_string(info.width_px) + "x" +
                           std::to_string(info.height_px) + ", at most " + std::to_string(kMaxPictureSidePx) +
                           " px a side are read");
}

Result<ImageFileInfo> PngInfo(const std::string& path, Bytes bytes) {
  PngReader png;
  if (!png.Begin(bytes)) return BadFile(path, std::string("damaged PNG: ") + png.image.message);
  const auto pixels = [](png_uint_32 side) { return static_cast<int>(std::min(side, png_uint_32{1} << 30)); };
  return Checked(path, {PixelFormat::kGray8, pixels(png.image.width), pixels(png.image.height)});
}

Result<ImageFileInfo> JpegInfo(const std::string& path, Bytes bytes) {
  const std::unique_ptr<void, int (*)(tjhandle)> jpeg(tjInitDecompress(), &tjDestroy);
  ImageFileInfo info{.format = PixelFormat::kMjpeg};
  int subsampling = 0, colorspace = 0;
  if (!jpeg || tjDecompressHeader3(jpeg.get(), bytes.data(), static_cast<unsigned long>(bytes.size()),
                                   &info.width_px, &info.height_px, &subsampling, &colorspace)) {
    return BadFile(path, std::string("damaged JPEG: ") + tjGetErrorStr2(jpeg.get()));
  }
  return Checked(path, info);
}

Result<ImageFileInfo> Info(const std::string& path, Bytes bytes) {
  if (IsPng(bytes)) return PngInfo(path, bytes);
  if (IsJpeg(bytes)) return JpegInfo(path, bytes);
  return BadFile(path,
                 bytes.empty() ? "is empty, not a PNG or JPEG picture" : "is not a PNG or JPEG picture");
}

/// In place, three bytes a pixel to one; the weights of cv::cvtColor.
void GrayFromRgb(std::vector<uint8_t>& pixels) {
  const size_t count = pixels.size() / 3;
  for (size_t i = 0; i < count; ++i) {
    const int r = pixels[3 * i], g = pixels[3 * i + 1], b = pixels[3 * i + 2];
    pixels[i] = static_cast<uint8_t>((4899 * r + 9617 * g + 1868 * b + (1 << 13)) >> 14);
  }
  pixels.resize(count);
}

Result<void> DecodePng(const std::string& path, Bytes bytes, std::vector<uint8_t>& gray) {
  PngReader png;
  if (!png.Begin(bytes)) return BadFile(path, std::string("damaged PNG: ") + png.image.message);
  const bool color = (png.image.format & PNG_FORMAT_FLAG_COLOR) != 0;
  png.image.format = color ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
  gray.resize(PNG_IMAGE_SIZE(png.image));
  if (!png.Finish(gray)) return BadFile(path, std::string("damaged PNG: ") + png.image.message);
  if (color) GrayFromRgb(gray);
  return {};
}

}  // namespace

Result<ImageFileInfo> ReadImageInfo(const std::string& path) {
  Result<ImageFileInfo> info = BadFile(path, "");
  for (const size_t limit : kHeaderBytes) {
    const auto bytes = ReadBeginning(path, limit);
    if (!bytes) return bytes.error();
    info = Info(path, BytesOf(*bytes));
    if (info || bytes->size() < limit) break;
  }
  return info;
}

Result<void> ReadRawImage(const std::string& path, RawImage& image) {
  image.valid = false;
  const auto file = ReadFile(path, kMaxFileBytes);
  if (!file) return file.error();
  const Bytes bytes = BytesOf(*file);
  const auto info = Info(path, bytes);
  if (!info) return info.error();
  image.format = info->format;
  image.width_px = info->width_px;
  image.height_px = info->height_px;
  if (info->format == PixelFormat::kGray8) {
    if (auto decoded = DecodePng(path, bytes, image.bytes); !decoded) return decoded;
  } else {
    image.bytes.assign(bytes.begin(), bytes.end());
  }
  image.valid = true;
  return {};
}

Result<cv::Mat> ReadGrayImage(const std::string& path) {
  RawImage image;
  if (auto read = ReadRawImage(path, image); !read) return read.error();
  cv::Mat gray;
  if (auto decoded = GrayDecoder().Decode(image, gray); !decoded) {
    return Error{decoded.error().code, path + ": " + decoded.error().message};
  }
  return gray;
}

Result<void> WritePng(const std::string& path, const cv::Mat& picture) {
  if (picture.dims != 2 || picture.empty() || (picture.type() != CV_8UC1 && picture.type() != CV_8UC3)) {
    return BadFile(path, "only gray or BGR pictures of 8 bits can be written");
  }
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.cols);
  image.height = static_cast<png_uint_32>(picture.rows);
  image.format = picture.channels() == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_BGR;
  image.flags = PNG_IMAGE_FLAG_FAST;  // camera noise hardly compresses anyway
  File file(std::fopen(path.c_str(), "wbe"));
  if (!file) return Error{ErrorCode::kUnavailable, path + ": can't be written: " + std::strerror(errno)};
  const bool encoded = png_image_write_to_stdio(&image, file.get(), 0, picture.data,
                                                static_cast<png_int_32>(picture.step[0]), nullptr) != 0;
  errno = 0;
  const bool closed = std::fclose(file.release()) == 0;
  if (encoded && closed) return {};
  std::error_code ignored;
  if (std::filesystem::is_regular_file(path, ignored)) std::filesystem::remove(path, ignored);
  return Error{ErrorCode::kUnavailable,
               path + ": can't be written: " + (encoded ? std::strerror(errno) : image.message)};
}

}  // namespace taclink

#include "sensing/capture/encode.h"

#include <turbojpeg.h>

#include <string>

namespace taclink {

struct JpegEncoder::Turbo {
  tjhandle handle = tjInitCompress();
  ~Turbo() {
    if (handle != nullptr) tjDestroy(handle);
  }
};

JpegEncoder::JpegEncoder() : turbo_(std::make_unique<Turbo>()) {}
JpegEncoder::~JpegEncoder() = default;

Result<void> JpegEncoder::Encode(const cv::Mat& gray, int quality, std::vector<uint8_t>& bytes) {
  if (gray.empty() || gray.type() != CV_8UC1)
    return Error{ErrorCode::kInvalidArgument, "only gray pictures of 8 bits can be made a JPEG"};
  bytes.resize(tjBufSize(gray.cols, gray.rows, TJSAMP_GRAY));
  unsigned char* out = bytes.data();
  unsigned long size = bytes.size();
  if (turbo_->handle == nullptr ||
      tjCompress2(turbo_->handle, gray.data, gray.cols, static_cast<int>(gray.step[0]), gray.rows, TJPF_GRAY,
                  &out, &size, TJSAMP_GRAY, quality, TJFLAG_NOREALLOC) != 0)
    return Error{ErrorCode::kInvalidArgument, std::string("no JPEG: ") + tjGetErrorStr2(turbo_->handle)};
  bytes.resize(size);
  return {};
}

}  // namespace taclink

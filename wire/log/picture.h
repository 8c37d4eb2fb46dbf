#pragma once

#include <google/protobuf/descriptor.h>

#include <memory>
#include <string>
#include <string_view>

#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink::wire::log {

/// A picture as a message of its type.
struct EncodedPicture {
  const google::protobuf::Descriptor* type = nullptr;
  std::shared_ptr<const std::string> bytes;
};
/// MJPEG becomes foxglove.CompressedImage, all else foxglove.RawImage; the bytes stay as the camera sent
/// them.
EncodedPicture EncodePicture(const RawImage& image, const std::string& frame_id, int64_t exposure_utc_ns);

/// The same back, damaged ones too; the size of an MJPEG picture stays 0. `type`: the schema's name. Errors:
/// kInvalidArgument (no such message), kUnsupported (another format).
Result<RawImage> DecodePicture(std::string_view type, std::string_view bytes);

}  // namespace taclink::wire::log

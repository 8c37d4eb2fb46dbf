#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "mcap/reader.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink::server {

/// What a link's cameras saw in one frame of a log.
struct LogPictures {
  uint32_t sequence = 0;  ///< of the frame, its low 32 bits
  int64_t exposure_utc_ns = 0;
  std::array<RawImage, kCameraCount> images;
};

/// The newest that were exposed until `utc_ns`, but not more than 2 s before. Errors: kNotFound (no such
/// link), kFailedPrecondition (there are none), kInvalidArgument (damaged).
Result<LogPictures> FindPictures(const mcap::Reader& reader, const std::string& link, int64_t utc_ns);

}  // namespace taclink::server

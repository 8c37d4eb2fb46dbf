#pragma once

#include <memory>
#include <optional>
#include <string>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"

namespace taclink {

struct FileOptions {
  std::string folder;
  double frame_rate_hz = 30;
  bool loop = true;  ///< begins again after the last pair; false: kEndOfData
  bool paced =
      true;  ///< at the frame rate, skipping what is late; false: every pair, as fast as they are asked for
  std::optional<double> start_after_s =
      {};                  ///< Start puts the first pair so long after a full second of `clock`,
                           ///< so that sources are in step, or out of it; none: at once
  bool in_memory = false;  ///< Start reads all pictures, so that Next only copies
  bool yuyv = false;       ///< gray pictures come as kYuyv, as most cameras would send them
};

/// Numbered picture pairs in a folder: top_000001.png and bottom_000001.png, also .jpg and .jpeg, any count
/// of digits, in the order of their numbers. A number with only one picture gives a frame whose other image
/// is not valid; so does a picture that is damaged, which says why and is counted. All must have one size,
/// which Start checks. PNG pictures come as kGray8 (or, with `yuyv`, kYuyv), JPEG ones as kMjpeg bytes. The
/// time of exposure is when a pair was due, by `clock`. Start's errors for want of pictures: as
/// CountPicturePairs.
std::unique_ptr<FrameSource> MakeFileSource(FileOptions options, Clock& clock);

/// Errors: kUnavailable (no such folder, or it can't be read), kInvalidArgument (no such pictures in it, or
/// two of one number).
Result<size_t> CountPicturePairs(const std::string& folder);

}  // namespace taclink

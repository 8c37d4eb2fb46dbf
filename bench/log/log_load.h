#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "bench/server/server_load.h"
#include "mcap/compression.h"
#include "sensing/core/result.h"

namespace taclink::command {

/// Messages as a recording has them, made once and written over and over.
struct LogContent {
  std::string name;
  std::string topic = {};
  std::vector<std::shared_ptr<const std::string>> messages = {};
  double rate_hz = 0;     ///< in a recording of six links at 30 frames a second
  std::string type = {};  ///< of the messages
};
/// Full frames of a link of 240 markers, with noise.
LogContent MakeFrameContent();
/// YUYV pictures, from `pictures`.
Result<LogContent> MakePictureContent(const LoadPictures& pictures);

/// How fast a log is written, against a plain write(2) of as many bytes; both until they are on the disk.
struct WriteResult {
  std::string content;
  mcap::Compression compression = mcap::Compression::kNone;
  double log_mb_s = 0;    ///< of the messages' bytes; median of the rounds
  double plain_mb_s = 0;  ///< likewise
  double ratio = 0;       ///< of the two of a round; median
  double size = 0;        ///< of the file, per byte of message
  double cpu_us = 0;      ///< of this process, per message
};
Result<WriteResult> MeasureWriting(const LogContent& content, mcap::Compression compression,
                                   const std::string& folder, double megabytes, int rounds);

/// How a log of a size is read, from the page cache.
struct ReadResult {
  double gigabytes = 0;
  double hours = 0;  ///< that a recording of six links with pictures would last
  uint64_t messages = 0;
  double open_ms = 0;
  double seek_p50_ms = 0, seek_p99_ms = 0;  ///< from a time to the first message after it
  double read_mb_s = 0;                     ///< one after another
};
Result<ReadResult> MeasureReading(const std::vector<LogContent>& contents, const std::string& folder,
                                  double gigabytes);

/// A server of six links at 30 frames a second with a recorder, for a while.
struct RecordResult {
  std::string what;
  double seconds = 0;
  uint64_t frames = 0, lost = 0, skipped = 0;
  double mb_s = 0;           ///< of the log
  double server_cores = 0;   ///< CPU time of the server per time
  double without_cores = 0;  ///< of the same server before it recorded
};
Result<std::vector<RecordResult>> MeasureRecording(const LoadPictures& pictures, const std::string& taclinkd,
                                                   const std::string& folder, double seconds);

}  // namespace taclink::command

#pragma once

#include <functional>
#include <ostream>
#include <string>

#include "mcap/compression.h"
#include "sensing/yaml/yaml_reader.h"

namespace taclink::server {

/// The section `recording` of the configuration.
struct RecordingConfig {
  std::string folder = {};  ///< of the logs, made when it is needed; empty: nothing can be recorded
  bool at_start = false;    ///< begin with the server
  bool pictures = false;    ///< of that recording: the cameras' pictures too
  mcap::Compression compression = mcap::Compression::kZstd;  ///< of recordings without pictures
  mcap::Compression picture_compression = mcap::Compression::kNone;
  double split_mb = 1024;     ///< a log that has become as large is closed, and the next one begun; 0: never
  double split_s = 3600;      ///< likewise, as old
  double quota_mb = 0;        ///< of all logs in the folder: the oldest are deleted; 0: none
  double sync_s = 1;          ///< what is older is safe from a power cut
  double queue_mb = 256;      ///< that may wait for a slow disk
  double scene_rate_hz = 10;  ///< of what Foxglove draws, of each link; 0: none
};

/// `path` makes a path of the file usable. Without `folder` in the file: taclink/logs in XDG_STATE_HOME, or
/// in .local/state of the home folder.
RecordingConfig ReadRecording(YamlMap& root, const std::function<std::string(const std::string&)>& path);
void WriteRecording(std::ostream& out, const RecordingConfig& config);

}  // namespace taclink::server

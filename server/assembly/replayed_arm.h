#pragma once

#include <memory>
#include <string>

#include "mcap/reader.h"
#include "sensing/core/clock.h"
#include "server/arm/arm.h"
#include "server/config/config.h"
#include "server/recording/log_file.h"
#include "server/replay/joint_replay.h"

namespace taclink::server {

/// A log that stands in for the cameras.
struct ReplayedLog {
  std::string path;
  std::shared_ptr<const mcap::Reader> reader;
};

/// Errors: the file's, or the reader's, with its path.
Result<ReplayedLog> OpenReplayedLog(const std::string& path);

/// `server` with the arm that the log's own configuration describes, as far as the log has frames of its
/// links. Errors: kInvalidArgument (no configuration, one that this build does not know, no frames).
Result<Config> ConfigureReplay(const ReplayedLog& log, Config server);

struct ReplayedArm {
  std::unique_ptr<Arm> arm;
  std::unique_ptr<JointReplay> joints;  ///< null: the arm has no joints; goes before the arm
  LogPreamble preamble;                 ///< of logs that are recorded of it
};

/// An arm, not started, whose links play the log round after round. `config`: by ConfigureReplay. Errors:
/// kInvalidArgument (a model is missing or wrong).
Result<ReplayedArm> BuildReplayedArm(const ReplayedLog& log, const Config& config, const std::string& version,
                                     Clock& clock);

}  // namespace taclink::server

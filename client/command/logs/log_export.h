#pragma once

#include <string>

#include "client/command/logs/log_source.h"

namespace taclink::command {

// Each writes a part of a log to new files in `folder`, which is there, and says on stdout what it wrote. SI
// units. Memory does not grow with the log. Errors: the files'.

/// contacts.csv, frames.csv, events.csv, joints.csv: a row for each contact of each frame, for each frame,
/// for each event, for each joint of each sample.
Result<void> ExportCsv(LogSource& source, const LogPart& part, const std::string& folder);

/// messages.jsonl: each protobuf message as one line {"topic", "schema", "log_time_ns", "publish_time_ns",
/// "sequence", "message"}; a picture's bytes are left out and counted in "left_out_bytes", unless
/// `with_pictures`.
Result<void> ExportJsonl(LogSource& source, const LogPart& part, const std::string& folder,
                         bool with_pictures);

/// LINK.npz for each link with frames; the arrays are listed in log_export_npz.cpp. N frames, M markers (the
/// most of any frame), K contacts of all frames. What was not measured is NaN, or 0 in marker_sources.
Result<void> ExportNpz(LogSource& source, const LogPart& part, const std::string& folder);

}  // namespace taclink::command

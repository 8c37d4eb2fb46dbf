#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "client/command/logs/log_source.h"
#include "taclink/v1/events.pb.h"
#include "taclink/v1/frame.pb.h"
#include "taclink/v1/log.pb.h"

namespace taclink::command {

/// Takes messages of the arm; `log_utc_ns`: when each came into the log. An error ends the visit.
struct LogVisitor {
  template <typename T>
  using Take = std::function<Result<void>(const T& message, int64_t log_utc_ns)>;

  Take<v1::LinkFrame> frame = {};
  Take<v1::Event> event = {};
  Take<v1::JointSample> joints = {};
};

/// Hands over the part's messages that the visitor takes, by log time. Events and joint states of the whole
/// arm belong to every part. What does not parse is noted as left out. Errors: the visitor's.
Result<void> Visit(LogSource& source, const LogPart& part, const LogVisitor& visitor);

/// Something is told about the skin: not lost, calibrating or starting.
bool IsMeasured(const v1::LinkFrame& frame);

/// "ok" of LINK_STATUS_OK: an enum's name without its type's, in lower case. `name` empty (a later
/// version's): the number.
std::string EnumText(const std::string& name, const std::string& prefix, int number);

}  // namespace taclink::command

#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>

#include "mcap/bytes.h"
#include "sensing/core/result.h"
#include "wire/detail.h"
#include "wire/log/topics.h"

namespace taclink::wire::log {

struct ReplayedForm {
  Detail detail = Detail::kFull;     ///< of frames
  std::set<std::string> links = {};  ///< that events and losses may be of; none: all
};

/// The bytes of the ReplayResponse that holds a log's message. Frames are marked LinkFrame.replayed and
/// stripped to the level of detail; otherwise the message's bytes stay as they are. None: it is of another
/// link. Errors: kInvalidArgument (no such message, or of a kind that is not replayed).
Result<std::optional<std::string>> EncodeReplayed(TopicKind kind, mcap::Bytes data, int64_t log_utc_ns,
                                                  const ReplayedForm& form);

}  // namespace taclink::wire::log

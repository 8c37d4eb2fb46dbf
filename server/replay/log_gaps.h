#pragma once

#include <cstdint>
#include <vector>

#include "mcap/reader.h"

namespace taclink::server {

/// Long times without any message in a log: the clock was set while it was written, or it was joined of logs
/// of different days. They are played as a short pause. Maps log times (ns since 1970-01-01 UTC) to played
/// times, which rise with them, but only by kPauseNs over each gap. A pure value; default: no gaps.
class LogGaps {
 public:
  static constexpr int64_t kLeastGapNs = 10'000'000'000;
  static constexpr int64_t kPauseNs = 1'000'000'000;

  LogGaps() = default;
  /// Of the messages of all topics, as the index of the log's chunks tells it.
  explicit LogGaps(const mcap::Reader& reader);

  int64_t PlayedNs(int64_t log_utc_ns) const;
  /// The inverse: within a pause the end of the gap.
  int64_t LogUtcNs(int64_t played_ns) const;

 private:
  struct Gap {
    int64_t begin_utc_ns, end_utc_ns;
  };
  std::vector<Gap> gaps_;  // by time; none touch
};

}  // namespace taclink::server

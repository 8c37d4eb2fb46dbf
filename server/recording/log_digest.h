#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "taclink/v1/recording.pb.h"

namespace taclink::server {

/// What happens in a log at a glance (taclink.v1.LogSummary), while it is written. One thread.
class LogDigest {
 public:
  /// A frame that was written, at its log time.
  void Take(const std::string& link, const LinkModel& model, const LinkState& state, int64_t log_utc_ns);
  /// Of what was taken since the last Clear.
  v1::LogSummary Summary() const;
  void Clear();

 private:
  int64_t begin_utc_ns_ = 0;    // log time of the first frame; 0: none yet
  std::vector<float> peaks_n_;  // by second
  v1::StrongestContact strongest_;
};

}  // namespace taclink::server

#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "taclink/v1/tactile.pb.h"

namespace taclink::command {

/// What `taclink watch` shows on a terminal: the newest frame of each link, drawn over the last picture.
class LiveView {
 public:
  explicit LiveView(std::string title) : title_(std::move(title)) {}

  void Take(const v1::LinkFrame& frame);
  /// The whole picture with the control sequences that put it in the old one's place.
  std::string Draw(const v1::StreamStatus& status, std::chrono::steady_clock::time_point now);

 private:
  struct LinkView {
    v1::LinkFrame frame;
    std::optional<double> latency_s;  // of the frame, when it came
    std::chrono::steady_clock::time_point counted_since;
    int frames = 0;      // since counted_since
    double rate_hz = 0;  // as received
  };

  const std::string title_;
  std::map<uint32_t, LinkView> links_;  // by index
};

/// What `taclink watch` prints when its output is no terminal: a line when a contact begins, ends or changes
/// its force by a fifth, and when a link's status changes.
class ChangeLog {
 public:
  std::vector<std::string> Take(const v1::LinkFrame& frame);

 private:
  struct LinkLog {
    v1::LinkStatus status = v1::LINK_STATUS_UNSPECIFIED;
    std::string reason;
    std::map<uint64_t, double> told_force_n;  // by contact id
  };
  std::map<std::string, LinkLog> links_;
};

}  // namespace taclink::command

#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "client/cpp/taclink/client.h"

namespace taclink::command {

/// What `taclink watch` shows on a terminal: the newest frame of each link, drawn over the last picture.
class LiveView {
 public:
  explicit LiveView(std::string title) : title_(std::move(title)) {}

  void Take(const client::Frame& frame);
  /// The whole picture with the control sequences that put it in the old one's place.
  std::string Draw(const std::vector<client::StreamCounts>& counts,
                   std::chrono::steady_clock::time_point now);

 private:
  struct LinkView {
    client::Frame frame;
    std::chrono::steady_clock::time_point counted_since;
    int frames = 0;      // since counted_since
    double rate_hz = 0;  // as received
  };

  const std::string title_;
  std::map<int, LinkView> links_;  // by index
};

/// What `taclink watch` prints when its output is no terminal: a line when a contact begins, ends or changes
/// its force by a fifth, and when a link's status changes.
class ChangeLog {
 public:
  std::vector<std::string> Take(const client::Frame& frame);

 private:
  struct LinkLog {
    client::LinkStatus status = client::LinkStatus::kUnknown;
    std::string reason;
    std::map<uint64_t, double> told_force_n;  // by contact id
  };
  std::map<std::string, LinkLog> links_;
};

}  // namespace taclink::command

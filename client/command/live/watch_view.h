#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "taclink/v1/tactile.pb.h"

namespace taclink::command {

/// What `taclink watch` shows on a terminal: a row for each link with its force as a bar and over the last
/// seconds, below them all contacts by force; drawn over the last picture.
class LiveView {
 public:
  /// `color`: see WantsColor.
  LiveView(std::string title, bool color) : title_(std::move(title)), color_(color) {}

  void Take(const v1::LinkFrame& frame);
  /// The whole picture with the control sequences that put it in the old one's place. `footer`: lines below.
  std::string Draw(const v1::StreamStatus& status, std::chrono::steady_clock::time_point now,
                   const std::vector<std::string>& footer = {});

 private:
  struct LinkView {
    v1::LinkFrame frame;
    std::optional<double> latency_s;  // of the frame, when it came
    std::chrono::steady_clock::time_point counted_since;
    int frames = 0;               // since counted_since
    double rate_hz = 0;           // as received
    std::deque<double> forces_n;  // totals of the last seconds, oldest first; NaN: not known
    std::chrono::steady_clock::time_point sampled;
  };
  struct Touch {
    const v1::LinkFrame* frame;
    const v1::Contact* contact;
    double force_n;
  };

  void Count(LinkView& view, std::chrono::steady_clock::time_point now) const;
  std::string Row(const LinkView& view, size_t name_width, double top_n) const;
  std::vector<Touch> TouchesByForce() const;

  const std::string title_;
  const bool color_;
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

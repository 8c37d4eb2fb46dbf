#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "client/command/live/watch_view.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {

/// Where frames go on standard output: JSON lines, a view that is drawn over (on a terminal), or lines of
/// what changes.
class FrameOutput {
 public:
  /// `title`: of the view.
  FrameOutput(const std::string& title, bool json);

  void Take(const client::Frame& frame, const std::vector<client::StreamCounts>& counts = {});
  /// Draws the view, now and then.
  void Refresh(const std::vector<client::StreamCounts>& counts = {});
  bool drawn_over() const { return live_; }

 private:
  void PrintDrops(const std::vector<client::StreamCounts>& counts);

  const bool json_;
  const bool live_;
  LiveView view_;
  ChangeLog log_;
  uint64_t dropped_ = 0;
  std::chrono::steady_clock::time_point drawn_;
};

}  // namespace taclink::command

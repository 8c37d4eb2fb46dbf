#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "client/command/live/watch_view.h"
#include "taclink/v1/tactile.pb.h"

namespace taclink::command {

/// Where frames go on standard output: JSON lines, a view that is drawn over (on a terminal), or lines of
/// what changes.
class FrameOutput {
 public:
  /// `title`: of the view.
  FrameOutput(const std::string& title, bool json);

  void Take(const v1::LinkFrame& frame, const v1::StreamStatus& status = {});
  /// Draws the view, now and then; while it is paused, only where the footer has changed.
  void Refresh(const v1::StreamStatus& status = {}, const std::vector<std::string>& footer = {},
               bool paused = false);
  bool drawn_over() const { return live_; }

 private:
  void PrintDrops(const v1::StreamStatus& status);

  const bool json_;
  const bool live_;
  LiveView view_;
  ChangeLog log_;
  uint64_t dropped_ = 0;
  std::chrono::steady_clock::time_point drawn_;
  std::vector<std::string> footer_;  // as drawn
};

}  // namespace taclink::command

#include "client/command/live/frame_output.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "client/command/cli/json.h"
#include "client/command/cli/terminal_style.h"
#include "client/command/live/frame_json.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kRedraw{100};
constexpr const char* kClearScreen = "\x1b[2J";

}  // namespace

FrameOutput::FrameOutput(const std::string& title, bool json)
    : json_(json), live_(!json && isatty(STDOUT_FILENO) == 1), view_(title, WantsColor()) {
  if (live_) fmt::print("{}", kClearScreen);
}

void FrameOutput::Take(const v1::LinkFrame& frame, const v1::StreamStatus& status) {
  if (json_) {
    PrintDrops(status);
    fmt::print("{}\n", FrameJson(frame));
    std::fflush(stdout);
  } else if (live_) {
    view_.Take(frame);
  } else {
    for (const auto& line : log_.Take(frame)) fmt::print("{}\n", Printable(line));
    std::fflush(stdout);
  }
}

void FrameOutput::Refresh(const v1::StreamStatus& status, const std::vector<std::string>& footer,
                          bool paused) {
  const auto now = steady_clock::now();
  if (!live_ || now - drawn_ < kRedraw || (paused && footer == footer_)) return;
  footer_ = footer;
  drawn_ = now;
  fmt::print("{}", view_.Draw(status, now, footer));
  std::fflush(stdout);
}

// A line of its own whenever the server left something out: {"dropped": {"link": frames since the start}}.
void FrameOutput::PrintDrops(const v1::StreamStatus& status) {
  uint64_t total = 0;
  Json dropped = Json::object();
  for (const v1::LinkStreamCounts& link : status.links()) {
    total += link.frames_dropped();
    dropped[link.link()] = link.frames_dropped();
  }
  if (total == dropped_) return;
  dropped_ = total;
  fmt::print("{}\n", Json({{"dropped", dropped}}).dump());
}

}  // namespace taclink::command

#include "client/command/live/frame_output.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "client/command/cli/json.h"
#include "client/command/live/frame_json.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kRedraw{100};
constexpr const char* kClearScreen = "\x1b[2J";

}  // namespace

FrameOutput::FrameOutput(const std::string& title, bool json)
    : json_(json), live_(!json && isatty(STDOUT_FILENO) == 1), view_(title) {
  if (live_) fmt::print("{}", kClearScreen);
}

void FrameOutput::Take(const client::Frame& frame, const std::vector<client::StreamCounts>& counts) {
  if (json_) {
    PrintDrops(counts);
    fmt::print("{}\n", FrameJson(frame));
    std::fflush(stdout);
  } else if (live_) {
    view_.Take(frame);
  } else {
    for (const auto& line : log_.Take(frame)) fmt::print("{}\n", Printable(line));
    std::fflush(stdout);
  }
}

void FrameOutput::Refresh(const std::vector<client::StreamCounts>& counts) {
  const auto now = steady_clock::now();
  if (!live_ || now - drawn_ < kRedraw) return;
  drawn_ = now;
  fmt::print("{}", view_.Draw(counts, now));
  std::fflush(stdout);
}

// A line of its own whenever the server left something out: {"dropped": {"link": frames since the start}}.
void FrameOutput::PrintDrops(const std::vector<client::StreamCounts>& counts) {
  uint64_t total = 0;
  Json dropped = Json::object();
  for (const auto& link : counts) {
    total += link.frames_dropped;
    dropped[link.link] = link.frames_dropped;
  }
  if (total == dropped_) return;
  dropped_ = total;
  fmt::print("{}\n", Json({{"dropped", dropped}}).dump());
}

}  // namespace taclink::command

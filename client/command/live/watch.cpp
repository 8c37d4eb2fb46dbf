#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>

#include "client/command/cli/commands.h"
#include "client/command/cli/interrupt.h"
#include "client/command/live/connect.h"
#include "client/command/live/frame_output.h"
#include "client/command/live/watch_keys.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {
namespace {

struct WatchOptions {
  std::string server = "127.0.0.1:50051";
  std::vector<std::string> links;
  std::string detail = "contacts";
  double rate_hz = 0;
  double deadband_n = 0, deadband_mm = 0;
  std::optional<double> patience_s;
  bool every = false;
  bool json = false;
  uint64_t count = 0;
};

v1::StreamFramesRequest ToStream(const WatchOptions& options) {
  v1::StreamFramesRequest request;
  request.mutable_links()->Assign(options.links.begin(), options.links.end());
  request.set_detail(*client::ValueOf<v1::Detail>(options.detail));
  request.set_max_rate_hz(options.rate_hz);
  request.set_delivery(options.every ? v1::DELIVERY_EVERY : v1::DELIVERY_LATEST);
  request.set_deadband_force_n(options.deadband_n);
  request.set_deadband_move_m(options.deadband_mm * 1e-3);
  return request;
}

Result<void> RunWatch(const WatchOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  auto reader = connection->StreamFrames(ToStream(options));
  if (!reader) return reader.error();
  CatchInterrupts();
  WatchKeys keys(*connection);
  FrameOutput output("taclink watch " + options.server + "   (Ctrl-C ends)", options.json);
  // Every link says something once a second, so silence means a server or a network that hangs.
  const double chosen_s =
      options.patience_s.value_or(std::chrono::duration<double>(SilencePatience()).count());
  const double patience_s = std::max(chosen_s, options.rate_hz > 0 ? 3 / options.rate_hz : 0);
  double silence_s = 0;
  for (uint64_t taken = 0; !IsInterrupted() && (options.count == 0 || taken < options.count);) {
    const auto frame = (*reader)->Next(kInterruptPoll);
    if (frame) {
      silence_s = 0;
      if (!keys.paused()) output.Take(*frame, (*reader)->status());
      ++taken;
    } else if (frame.error().code != ErrorCode::kTimeout) {
      return frame.error();
    } else if (silence_s += std::chrono::duration<double>(kInterruptPoll).count(); silence_s > patience_s) {
      return Error{ErrorCode::kUnavailable,
                   fmt::format("nothing from the server at {} for {:.0f} s; check server and "
                               "network",
                               options.server, patience_s)};
    }
    if (std::ferror(stdout) != 0) break;  // main reports it
    if (output.drawn_over()) keys.Run();
    if (keys.ends()) break;
    output.Refresh((*reader)->status(), {keys.message(), keys.Help()}, keys.paused());
  }
  return {};
}

}  // namespace

void AddWatch(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<WatchOptions>();
  const Arguments command = app.AddCommand("watch", "Show contacts and forces live");
  AddServerOption(command, options->server);
  command.AddOption("--links", options->links, "Names of links, separated by commas (all)").Delimiter(',');
  command.AddOption("--rate", options->rate_hz, "At most so many frames a second of each link (all)")
      .Must(Positive());
  command.AddOption("--detail", options->detail, "contacts, geometry or full")
      .Must(OneOf(client::Names<v1::Detail>()))
      .ShowDefault();
  command.AddOption("--deadband-force", options->deadband_n, "Pass over forces that change by less, N")
      .Must(Positive());
  command.AddOption("--deadband-move", options->deadband_mm, "Pass over markers that move by less, mm")
      .Must(Positive());
  command.AddFlag("--every", options->every, "Every frame in order, not only the newest");
  command.AddFlag("--json", options->json, "One JSON object a line for each frame");
  command
      .AddOption("--patience", options->patience_s,
                 "Seconds without any word before it gives up (5, or TACLINK_PATIENCE_S if that is more)")
      .Must(Positive());
  command.AddOption("--count", options->count, "End after so many frames").Must(Positive());
  command.OnChosen([options, &selected] { selected = [options] { return RunWatch(*options); }; });
}

}  // namespace taclink::command

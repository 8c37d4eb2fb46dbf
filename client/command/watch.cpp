#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>

#include "client/command/commands.h"
#include "client/command/connect.h"
#include "client/command/frame_json.h"
#include "client/command/json.h"
#include "client/command/watch_view.h"
#include "client/taclink/client.h"

namespace taclink::command {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds kPoll{100};  // how soon Ctrl-C is noticed
constexpr milliseconds kRedraw{100};
constexpr const char* kClearScreen = "\x1b[2J";

struct Options {
  std::string server = "127.0.0.1:50051";
  std::vector<std::string> links;
  std::string detail = "contacts";
  double rate_hz = 0;
  double deadband_n = 0, deadband_mm = 0;
  double patience_s = 5;
  bool every = false;
  bool json = false;
  uint64_t count = 0;
};

std::atomic<bool> interrupted = false;

client::StreamOptions ToStream(const Options& options) {
  return {.links = options.links,
          .detail = options.detail == "full"       ? client::Detail::kFull
                    : options.detail == "geometry" ? client::Detail::kGeometry
                                                   : client::Detail::kContacts,
          .max_rate_hz = options.rate_hz,
          .delivery = options.every ? client::Delivery::kEvery : client::Delivery::kLatest,
          .deadband_force_n = options.deadband_n,
          .deadband_move_m = options.deadband_mm * 1e-3};
}

/// Where frames go: one of three forms.
class Output {
 public:
  explicit Output(const Options& options)
      : json_(options.json),
        live_(!options.json && isatty(STDOUT_FILENO) == 1),
        view_("taclink watch " + options.server + "   (Ctrl-C ends)") {
    if (live_) fmt::print("{}", kClearScreen);
  }

  void Take(const client::Frame& frame, const std::vector<client::StreamCounts>& counts) {
    if (json_) {
      PrintDrops(counts);
      fmt::print("{}\n", FrameJson(frame));
      std::fflush(stdout);
    } else if (live_) {
      view_.Take(frame);
    } else {
      for (const auto& line : log_.Take(frame)) fmt::print("{}\n", line);
      std::fflush(stdout);
    }
  }

  void Refresh(const client::FrameReader& reader) {
    const auto now = steady_clock::now();
    if (!live_ || now - drawn_ < kRedraw) return;
    drawn_ = now;
    fmt::print("{}", view_.Draw(reader.counts(), now));
    std::fflush(stdout);
  }

 private:
  // A line of its own whenever the server left something out: {"dropped": {"link": frames since the start}}.
  void PrintDrops(const std::vector<client::StreamCounts>& counts) {
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

  const bool json_;
  const bool live_;
  LiveView view_;
  ChangeLog log_;
  uint64_t dropped_ = 0;
  steady_clock::time_point drawn_;
};

Result<void> Run(const Options& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  auto reader = connection->StreamFrames(ToStream(options));
  if (!reader) return reader.error();
  std::signal(SIGINT, [](int) { interrupted = true; });
  std::signal(SIGTERM, [](int) { interrupted = true; });
  Output output(options);
  // Every link says something once a second, so silence means a server or a network that hangs.
  const double patience_s = std::max(options.patience_s, options.rate_hz > 0 ? 3 / options.rate_hz : 0);
  double silence_s = 0;
  for (uint64_t taken = 0; !interrupted && (options.count == 0 || taken < options.count);) {
    const auto frame = (*reader)->Next(kPoll);
    if (frame) {
      silence_s = 0;
      output.Take(*frame, (*reader)->counts());
      ++taken;
    } else if (frame.error().code != ErrorCode::kTimeout) {
      return frame.error();
    } else if (silence_s += std::chrono::duration<double>(kPoll).count(); silence_s > patience_s) {
      return Error{ErrorCode::kUnavailable,
                   fmt::format("nothing from the server at {} for {:.0f} s; check server and "
                               "network",
                               options.server, patience_s)};
    }
    if (std::ferror(stdout) != 0) break;  // main reports it
    output.Refresh(**reader);
  }
  return {};
}

}  // namespace

void AddWatch(CLI::App& app, Selected& selected) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("watch", "Show contacts and forces live");
  AddServerOption(*command, options->server);
  command->add_option("--links", options->links, "Names of links, separated by commas (all)")->delimiter(',');
  command->add_option("--rate", options->rate_hz, "At most so many frames a second of each link (all)")
      ->check(CLI::PositiveNumber);
  command->add_option("--detail", options->detail, "contacts, geometry or full")
      ->check(CLI::IsMember({"contacts", "geometry", "full"}))
      ->capture_default_str();
  command->add_option("--deadband-force", options->deadband_n, "Pass over forces that change by less, N")
      ->check(CLI::PositiveNumber);
  command->add_option("--deadband-move", options->deadband_mm, "Pass over markers that move by less, mm")
      ->check(CLI::PositiveNumber);
  command->add_flag("--every", options->every, "Every frame in order, not only the newest");
  command->add_flag("--json", options->json, "One JSON object a line for each frame");
  command->add_option("--patience", options->patience_s, "Seconds without any word before it gives up")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--count", options->count, "End after so many frames")->check(CLI::PositiveNumber);
  command->callback([options, &selected] { selected = [options] { return Run(*options); }; });
}

}  // namespace taclink::command

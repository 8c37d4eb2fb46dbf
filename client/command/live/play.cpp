#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/command/cli/commands.h"
#include "client/command/cli/interrupt.h"
#include "client/command/cli/json.h"
#include "client/command/live/connect.h"
#include "client/command/live/contacts_view.h"
#include "client/command/live/event_text.h"
#include "client/command/live/frame_output.h"
#include "client/cpp/taclink/recordings.h"
#include "client/cpp/taclink/replay.h"

namespace taclink::command {
namespace {

constexpr double kSlowest = 0.1, kFastest = 100;

struct PlayOptions {
  std::string server = "127.0.0.1:50051";
  std::string log;
  std::vector<std::string> links;
  std::string detail = "contacts";
  double speed = 1, from_s = 0, to_s = 0;
  bool loop = false, events = false, contacts = false, json = false;
};

int64_t Ns(double seconds) {
  return static_cast<int64_t>(seconds * 1e9);
}

/// Seconds of the log become times.
Result<v1::ReplayRequest> ToReplay(const PlayOptions& options, client::Recordings& recordings) {
  v1::ReplayRequest replay;
  replay.set_log(options.log);
  replay.mutable_links()->Assign(options.links.begin(), options.links.end());
  replay.set_detail(*client::ValueOf<v1::Detail>(options.detail));
  replay.set_speed(options.speed);
  replay.set_loop(options.loop);
  replay.set_without_events(!options.events);
  replay.set_without_contacts(!options.contacts);
  replay.set_without_arm(true);
  if (options.from_s == 0 && options.to_s == 0) return replay;
  const auto logs = recordings.List();
  if (!logs) return logs.error();
  for (const v1::Log& log : logs->logs()) {
    if (log.name() != options.log) continue;
    if (log.start_utc_ns() == 0)
      return Error{ErrorCode::kFailedPrecondition,
                   options.log + " is being written, so its times are not known yet"};
    replay.set_from_utc_ns(log.start_utc_ns() + Ns(options.from_s));
    if (options.to_s > 0) replay.set_to_utc_ns(log.start_utc_ns() + Ns(options.to_s));
    return replay;
  }
  return replay;  // the server says that there is no such log
}

/// Prints what is played; tells at the end what was not as it should be.
class Output {
 public:
  explicit Output(const PlayOptions& options)
      : json_(options.json),
        frames_("taclink record play " + options.log + "   (Ctrl-C ends)", options.json) {}

  void Take(const v1::ReplayResponse& message) {
    if (message.has_status()) TakeStatus(message.status());
    if (message.has_frame()) return frames_.Take(message.frame());
    if (frames_.drawn_over()) return;
    if (message.has_event()) Line(json_ ? EventJson(message.event(), "") : EventText(message.event()));
    if (message.has_contacts())
      Line(json_ ? ContactsJson(message.contacts()) : ContactsTable(message.contacts()));
    if (message.has_loss()) TakeLoss(message.loss());
  }

  void Refresh() { frames_.Refresh(); }
  void Finish() const {
    if (damaged_ > 0)
      fmt::print(stderr,
                 "taclink: note: {} places of the log could not be read; 'taclink log check' says more\n",
                 damaged_);
    if (lateness_s_ > 0.1) fmt::print(stderr, "taclink: note: up to {:.1f} s late\n", lateness_s_);
  }

 private:
  void TakeStatus(const v1::ReplayStatus& status) {
    damaged_ = status.damaged();
    lateness_s_ = std::max(lateness_s_, status.lateness_s());
  }
  void TakeLoss(const v1::RecordingLoss& loss) const {
    Line(json_ ? Json({{"lost", {{"link", loss.link()}, {"frames", loss.count()}}}}).dump()
               : fmt::format("-- {}: {} frames are not in the log --", loss.link(), loss.count()));
  }
  static void Line(const std::string& text) {
    fmt::print("{}\n", text);
    std::fflush(stdout);
  }

  const bool json_;
  FrameOutput frames_;
  uint64_t damaged_ = 0;
  double lateness_s_ = 0;
};

Result<void> RunPlay(const PlayOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  auto recordings = connection->RecordingCalls();
  const auto replay = ToReplay(options, recordings);
  if (!replay) return replay.error();
  auto reader = recordings.Replay(*replay);
  if (!reader) return reader.error();
  CatchInterrupts();
  Output output(options);
  while (!IsInterrupted()) {
    const auto message = (*reader)->Next(kInterruptPoll);
    if (message) {
      output.Take(*message);
    } else if (message.error().code == ErrorCode::kEndOfData) {
      break;
    } else if (message.error().code != ErrorCode::kTimeout) {
      return message.error();
    }
    if (std::ferror(stdout) != 0) break;  // main reports it
    output.Refresh();
  }
  output.Finish();
  return {};
}

}  // namespace

void AddPlay(const Arguments& record, Selected& selected) {
  auto options = std::make_shared<PlayOptions>();
  const Arguments command =
      record.AddCommand("play", "Show a log of the server at its pace, as 'watch' does");
  AddServerOption(command, options->server);
  command.AddOption("log", options->log, "Name of the log, as 'list' shows it").Required();
  command.AddOption("--link", options->links, "Names of links (default: all)");
  command.AddOption("--detail", options->detail, "contacts, geometry or full")
      .Must(OneOf(client::Names<v1::Detail>()))
      .ShowDefault();
  const auto check = [](const std::string& text) {
    const std::string outside = Within(kSlowest, kFastest).Problem(text);
    return text == "0" ? std::string() : outside;
  };
  command.AddOption("--speed", options->speed, "0.1 to 100 times as it happened; 0: as fast as it can")
      .Must(Check(check))
      .ShowDefault();
  command.AddOption("--from", options->from_s, "Begin so many seconds after the log's first message")
      .Must(Within(0, 1e9));
  command.AddOption("--to", options->to_s, "End there; 0: at its last one").Must(Within(0, 1e9));
  command.AddFlag("--loop", options->loop, "Begin again at the end");
  command.AddFlag("--events", options->events, "Also events, as 'events' prints them");
  command.AddFlag("--contacts", options->contacts, "Also the arm's contacts, as 'contacts' prints them");
  command.AddFlag("--json", options->json, "One JSON object a line");
  command.OnChosen([options, &selected] { selected = [options] { return RunPlay(*options); }; });
}

}  // namespace taclink::command

#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "client/command/cli/commands.h"
#include "client/command/cli/interrupt.h"
#include "client/command/cli/json.h"
#include "client/command/live/connect.h"
#include "client/command/live/event_text.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {
namespace {

struct EventsOptions {
  std::string server = "127.0.0.1:50051";
  std::vector<std::string> links, kinds;
  std::string run_id;
  std::optional<uint64_t> after;
  bool all = false;
  bool json = false;
  uint64_t count = 0;
};

void PrintLost(bool json, const client::EventReader& reader, uint64_t& told) {
  if (reader.status().events_lost() == told) return;
  told = reader.status().events_lost();
  if (json) {
    fmt::print("{}\n", Json({{"lost", told}}).dump());
  } else {
    fmt::print("-- {} events are lost: they had left the server's history --\n", told);
  }
}

void PrintStart(bool json, const client::EventReader& reader) {
  if (reader.status().run_changed()) {
    fmt::print("{}\n", json ? Json({{"run_changed", true}, {"run_id", reader.status().run_id()}}).dump()
                            : "-- the server was restarted: the end of its former run is unknown --");
  }
  std::fflush(stdout);
}

Result<void> RunEvents(const EventsOptions& options) {
  v1::StreamEventsRequest request;
  request.mutable_links()->Assign(options.links.begin(), options.links.end());
  for (const std::string& name : options.kinds) request.add_kinds(*client::ValueOf<v1::EventKind>(name));
  if (options.all) request.set_after_sequence(0);
  if (options.after) {
    request.set_run_id(options.run_id);
    request.set_after_sequence(*options.after);
  }
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  auto reader = connection->StreamEvents(request);
  if (!reader) return reader.error();
  CatchInterrupts();
  PrintStart(options.json, **reader);
  uint64_t lost_told = 0;
  for (uint64_t taken = 0; !IsInterrupted() && (options.count == 0 || taken < options.count);) {
    const auto event = (*reader)->Next(kInterruptPoll);
    PrintLost(options.json, **reader, lost_told);
    if (event) {
      fmt::print("{}\n", options.json ? EventJson(*event, (*reader)->status().run_id()) : EventText(*event));
      ++taken;
    } else if (event.error().code != ErrorCode::kTimeout) {
      return event.error();
    }
    std::fflush(stdout);
    if (std::ferror(stdout) != 0) break;  // main reports it
  }
  return {};
}

}  // namespace

void AddEvents(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<EventsOptions>();
  const Arguments command = app.AddCommand(
      "events", "Show what happens to a server's links: contacts, force levels, status, tares, drift");
  AddServerOption(command, options->server);
  command.AddOption("--links", options->links, "Names of links, separated by commas (all)").Delimiter(',');
  const auto check = [](const std::string& name) {
    return client::ValueOf<v1::EventKind>(name) ? std::string() : "'" + name + "' is not a kind of event";
  };
  command
      .AddOption("--kinds", options->kinds, "Kinds of events, separated by commas (all): contact_begin, ...")
      .Delimiter(',')
      .Must(Check(check));
  const Option run =
      command.AddOption("--run", options->run_id, "With --after: the run that the number belongs to");
  command.AddOption("--after", options->after, "Resume after this event's number").Needs(run);
  command.AddFlag("--all", options->all, "Begin with all that the server still has");
  command.AddFlag("--json", options->json, "One JSON object a line for each event");
  command.AddOption("--count", options->count, "End after so many events").Must(Positive());
  command.OnChosen([options, &selected] { selected = [options] { return RunEvents(*options); }; });
}

}  // namespace taclink::command

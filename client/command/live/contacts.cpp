#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <memory>

#include "client/command/cli/commands.h"
#include "client/command/cli/interrupt.h"
#include "client/command/live/connect.h"
#include "client/command/live/contacts_view.h"
#include "client/cpp/taclink/arm_contacts.h"

namespace taclink::command {
namespace {

using std::chrono::milliseconds;

constexpr const char* kHomeAndClear = "\x1b[H\x1b[2J";

struct ContactsOptions {
  std::string server = "127.0.0.1:50051";
  double rate_hz = 10;
  bool json = false;
  uint64_t count = 0;
};

Result<void> RunContacts(const ContactsOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  auto reader = connection->StreamContacts(options.rate_hz);
  if (!reader) return reader.error();
  CatchInterrupts();
  const bool live = !options.json && isatty(STDOUT_FILENO) == 1;
  const milliseconds patience = SilencePatience() + milliseconds(static_cast<int64_t>(3e3 / options.rate_hz));
  milliseconds silence{0};
  for (uint64_t taken = 0; !IsInterrupted() && (options.count == 0 || taken < options.count);) {
    const auto arm = (*reader)->Next(kInterruptPoll);
    if (!arm) {
      if (arm.error().code != ErrorCode::kTimeout) return arm.error();
      if ((silence += kInterruptPoll) > patience)
        return Error{ErrorCode::kUnavailable, "nothing from the server at " + options.server +
                                                  " for some seconds; check server and network"};
      continue;
    }
    silence = milliseconds(0);
    ++taken;
    fmt::print("{}{}", live ? kHomeAndClear : "",
               options.json ? ContactsJson(*arm) + "\n" : ContactsTable(*arm));
    std::fflush(stdout);
    if (std::ferror(stdout) != 0) break;  // main reports it
  }
  return {};
}

}  // namespace

void AddContacts(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<ContactsOptions>();
  const Arguments command =
      app.AddCommand("contacts", "Show all contacts of the arm in its base frame, and joint torques");
  AddServerOption(command, options->server);
  command.AddOption("--rate", options->rate_hz, "At most so many a second")
      .Must(Within(0.001, 1000))
      .ShowDefault();
  command.AddFlag("--json", options->json, "One JSON object a line");
  command.AddOption("--count", options->count, "End after so many").Must(Positive());
  command.OnChosen([options, &selected] { selected = [options] { return RunContacts(*options); }; });
}

}  // namespace taclink::command

#include <fmt/format.h>

#include <memory>

#include "client/command/cli/commands.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {
namespace {

struct RestartOptions {
  std::string server = "127.0.0.1:50051";
  std::string link;
};

Result<void> RunRestart(const RestartOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  const auto ordered = connection->RestartLink(options.link);
  if (!ordered) return ordered.error();
  fmt::print("link {} is started again; 'taclink list' shows how it does\n", options.link);
  return {};
}

}  // namespace

void AddRestart(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<RestartOptions>();
  const Arguments command = app.AddCommand("restart", "Give a link of a server a fresh source and processor");
  AddServerOption(command, options->server);
  command.AddOption("--link", options->link, "Name of the link").Required();
  command.OnChosen([options, &selected] { selected = [options] { return RunRestart(*options); }; });
}

}  // namespace taclink::command

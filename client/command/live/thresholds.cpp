#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <optional>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {
namespace {

struct ThresholdsOptions {
  std::string server = "127.0.0.1:50051";
  std::string link, region;
  std::optional<double> warning_n, alarm_n, hysteresis_n;
  bool json = false;
};

std::string Force(double force_n) {
  return force_n > 0 ? fmt::format("{:.3f}", force_n) : "-";
}

void PrintText(const v1::Arm& arm) {
  fmt::print("{:<12}  {:<12}  {:>9}  {:>8}  {:>12}  {:<8}  {}\n", "LINK", "REGION", "WARNING N", "ALARM N",
             "HYSTERESIS N", "LEVEL", "FORCE N");
  for (const auto& link : arm.links()) {
    for (const auto& state : link.force_levels())
      fmt::print("{:<12}  {:<12}  {:>9}  {:>8}  {:>12.3f}  {:<8}  {:.3f}\n", link.name(),
                 state.region().empty() ? "-" : state.region(), Force(state.thresholds().warning_n()),
                 Force(state.thresholds().alarm_n()), state.thresholds().hysteresis_n(),
                 client::Name(state.level()), state.force_n());
  }
}

void PrintThresholdsJson(const v1::Arm& arm) {
  Json list = Json::array();
  for (const auto& link : arm.links()) {
    for (const auto& state : link.force_levels())
      list.push_back({{"link", link.name()},
                      {"region", state.region()},
                      {"warning_n", state.thresholds().warning_n()},
                      {"alarm_n", state.thresholds().alarm_n()},
                      {"hysteresis_n", state.thresholds().hysteresis_n()},
                      {"level", client::Name(state.level())},
                      {"force_n", state.force_n()}});
  }
  fmt::print("{}\n", Json({{"thresholds", std::move(list)}}).dump());
}

// What is not given stays as it is.
Result<void> Set(client::Client& connection, const ThresholdsOptions& options, const v1::Arm& arm) {
  v1::Thresholds thresholds;
  for (const auto& link : arm.links()) {
    for (const auto& state : link.force_levels()) {
      if (link.name() == options.link && state.region() == options.region) thresholds = state.thresholds();
    }
  }
  if (options.warning_n) thresholds.set_warning_n(*options.warning_n);
  if (options.alarm_n) thresholds.set_alarm_n(*options.alarm_n);
  if (options.hysteresis_n) thresholds.set_hysteresis_n(*options.hysteresis_n);
  const auto set = connection.SetThresholds(options.link, options.region, thresholds);
  return set ? Result<void>() : set.error();
}

Result<void> RunThresholds(const ThresholdsOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  auto arm = connection->GetArm();
  if (!arm) return arm.error();
  if (options.warning_n || options.alarm_n || options.hysteresis_n) {
    if (const auto set = Set(*connection, options, *arm); !set) return set.error();
    arm = connection->GetArm();
    if (!arm) return arm.error();
  }
  if (options.json) {
    PrintThresholdsJson(*arm);
  } else {
    PrintText(*arm);
  }
  return {};
}

}  // namespace

void AddThresholds(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<ThresholdsOptions>();
  const Arguments command = app.AddCommand(
      "thresholds",
      "Show the force thresholds of a server's links, or set those of one until the server ends");
  AddServerOption(command, options->server);
  const Option link = command.AddOption("--link", options->link, "The link whose thresholds are set");
  command.AddOption("--region", options->region, "A region of it (the whole link)").Needs(link);
  const auto force = [&](const char* name, std::optional<double>& value, const char* help) {
    command.AddOption(name, value, help).Must(Within(0, 10000)).Needs(link);
  };
  force("--warning", options->warning_n, "N; 0: none");
  force("--alarm", options->alarm_n, "N; 0: none");
  force("--hysteresis", options->hysteresis_n, "N below a threshold where its level is left");
  command.AddFlag("--json", options->json, "One JSON object");
  command.OnChosen([options, &selected] { selected = [options] { return RunThresholds(*options); }; });
}

}  // namespace taclink::command

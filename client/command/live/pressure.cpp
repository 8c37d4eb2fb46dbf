#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "client/command/cli/commands.h"
#include "client/command/cli/interrupt.h"
#include "client/command/cli/json.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {
namespace {

constexpr double kPascalsPerKpa = 1e3;
constexpr double kReachedPa = 50;  // of the setpoint, for --wait: the noise of a usual sensor
constexpr double kWaitMarginS = 30;
constexpr std::chrono::milliseconds kWaitPoll{200};

struct PressureOptions {
  std::string server = "127.0.0.1:50051";
  std::string link;
  double kpa = 0;
  std::optional<double> ramp_kpa_per_s;
  bool waits = false, resets = false, json = false;
};

std::string Kilopascals(bool is_there, double pa) {
  return is_there ? fmt::format("{:.3f}", pa / kPascalsPerKpa) : "-";
}

void PrintRegulatorText(const std::string& link, const v1::PressureRegulator& regulator) {
  fmt::print("link {}: {}, {} kPa measured, setpoint {}", link, client::Name(regulator.state()),
             Kilopascals(regulator.has_measured_pa(), regulator.measured_pa()),
             Kilopascals(regulator.has_setpoint_pa(), regulator.setpoint_pa()));
  if (regulator.has_target_pa() && regulator.target_pa() != regulator.setpoint_pa())
    fmt::print(" -> {:.3f} at {:g} kPa/s", regulator.target_pa() / kPascalsPerKpa,
               regulator.ramp_pa_per_s() / kPascalsPerKpa);
  fmt::print(" (limits {:g} to {:g} kPa)\n", regulator.min_pa() / kPascalsPerKpa,
             regulator.max_pa() / kPascalsPerKpa);
  if (regulator.has_trip()) fmt::print("  tripped: {}\n", regulator.trip().text());
  if (!regulator.trouble().empty()) fmt::print("  {}\n", regulator.trouble());
}

void PrintRegulatorJson(const std::string& link, const v1::PressureRegulator& regulator) {
  const auto number = [](bool is_there, double value) { return is_there ? Json(value) : Json(nullptr); };
  const Json line = {{"link", link},
                     {"state", client::Name(regulator.state())},
                     {"measured_pa", number(regulator.has_measured_pa(), regulator.measured_pa())},
                     {"age_s", number(regulator.has_age_s(), regulator.age_s())},
                     {"setpoint_pa", number(regulator.has_setpoint_pa(), regulator.setpoint_pa())},
                     {"target_pa", number(regulator.has_target_pa(), regulator.target_pa())},
                     {"ramp_pa_per_s", regulator.ramp_pa_per_s()},
                     {"effort", number(regulator.has_effort(), regulator.effort())},
                     {"trip", regulator.has_trip() ? Json(regulator.trip().text()) : Json(nullptr)},
                     {"trouble", regulator.trouble()},
                     {"min_pa", regulator.min_pa()},
                     {"max_pa", regulator.max_pa()}};
  fmt::print("{}\n", line.dump());
}

void PrintRegulator(const PressureOptions& options, const std::string& link,
                    const v1::PressureRegulator& regulator) {
  (options.json ? PrintRegulatorJson : PrintRegulatorText)(link, regulator);
  std::fflush(stdout);
}

Result<void> ShowRegulators(const PressureOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  if (!options.link.empty()) {
    const auto regulator = connection->GetPressure(options.link);
    if (!regulator) return regulator.error();
    PrintRegulator(options, options.link, *regulator);
    return {};
  }
  const auto arm = connection->GetArm();
  if (!arm) return arm.error();
  bool any = false;
  for (const auto& link : arm->links()) {
    if (!link.has_regulator()) continue;
    any = true;
    PrintRegulator(options, link.name(), link.regulator());
  }
  if (any) return {};
  return Error{ErrorCode::kFailedPrecondition,
               "no link of this arm has a pressure regulator; configure pressure: {source: regulator}"};
}

// Until the reading has arrived at the setpoint, or the regulator trips.
Result<void> WaitForPressure(client::Client& connection, const PressureOptions& options,
                             v1::PressureRegulator regulator) {
  const double way_pa = std::abs(regulator.target_pa() - regulator.setpoint_pa());
  const double limit_s = way_pa / regulator.ramp_pa_per_s() + kWaitMarginS;
  const double wanted_pa = regulator.target_pa();
  const auto begin = std::chrono::steady_clock::now();
  CatchInterrupts();
  while (true) {
    if (regulator.has_trip())
      return Error{ErrorCode::kFailedPrecondition, "the regulator has tripped: " + regulator.trip().text()};
    if (regulator.state() == v1::REGULATOR_STATE_CLOSED)
      return Error{ErrorCode::kFailedPrecondition,
                   "the valve was closed meanwhile: somebody has vented the skin"};
    if (std::abs(regulator.target_pa() - wanted_pa) > 1e-6)
      return Error{ErrorCode::kFailedPrecondition, fmt::format("somebody else has set {:.3f} kPa meanwhile",
                                                               regulator.target_pa() / kPascalsPerKpa)};
    const bool has_arrived = regulator.state() == v1::REGULATOR_STATE_HOLDING &&
                             std::abs(regulator.measured_pa() - regulator.target_pa()) <= kReachedPa;
    if (has_arrived) break;
    if (IsInterrupted())
      return Error{ErrorCode::kEndOfData, "interrupted; the pressure still moves to its setpoint"};
    if (std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() > limit_s)
      return Error{ErrorCode::kTimeout,
                   fmt::format("the pressure is {:.3f} kPa after {:.0f} s and not {:.3f} kPa; see 'taclink "
                               "pressure show'",
                               regulator.measured_pa() / kPascalsPerKpa, limit_s,
                               regulator.target_pa() / kPascalsPerKpa)};
    std::this_thread::sleep_for(kWaitPoll);
    auto next = connection.GetPressure(options.link);
    if (!next) return next.error();
    regulator = *std::move(next);
  }
  PrintRegulator(options, options.link, regulator);
  return {};
}

Result<void> OrderPressure(const PressureOptions& options, v1::SetPressureRequest request) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  request.set_link(options.link);
  request.set_reset_trip(options.resets);
  const auto regulator = connection->SetPressure(request);
  if (!regulator) return regulator.error();
  if (options.waits) return WaitForPressure(*connection, options, *regulator);
  PrintRegulator(options, options.link, *regulator);
  return {};
}

Result<void> MoveSetpointTo(const PressureOptions& options) {
  v1::SetPressureRequest request;
  request.set_pressure_pa(kPascalsPerKpa * options.kpa);
  if (options.ramp_kpa_per_s) request.set_ramp_pa_per_s(kPascalsPerKpa * *options.ramp_kpa_per_s);
  return OrderPressure(options, request);
}

Result<void> VentSkin(const PressureOptions& options) {
  v1::SetPressureRequest request;
  request.set_vent(true);
  return OrderPressure(options, request);
}

using PressureRun = Result<void> (*)(const PressureOptions& options);

Arguments AddPressureCommand(const Arguments& pressure, const char* name, const char* help,
                             const std::shared_ptr<PressureOptions>& options, Selected& selected,
                             PressureRun run) {
  const Arguments command = pressure.AddCommand(name, help);
  AddServerOption(command, options->server);
  command.AddFlag("--json", options->json, "One JSON object a line");
  command.OnChosen([options, run, &selected] { selected = [options, run] { return run(*options); }; });
  return command;
}

}  // namespace

void AddPressure(const Arguments& app, Selected& selected) {
  const Arguments pressure =
      app.AddCommand("pressure", "Show and set the pressure inside a skin that a regulator inflates");
  pressure.RequireCommand();
  auto options = std::make_shared<PressureOptions>();
  const Arguments show =
      AddPressureCommand(pressure, "show", "Show the regulators", options, selected, ShowRegulators);
  show.AddOption("link", options->link, "Name of the link (default: all that have a regulator)");
  const Arguments set = AddPressureCommand(pressure, "set", "Move the setpoint along a ramp", options,
                                           selected, MoveSetpointTo);
  set.AddOption("link", options->link, "Name of the link").Required();
  set.AddOption("kpa", options->kpa, "Gauge pressure, kPa").Required().Must(Within(0, 100));
  set.AddOption("--ramp", options->ramp_kpa_per_s, "kPa/s (default: as configured, the fastest)")
      .Must(Within(1e-6, 100));
  set.AddFlag("--wait", options->waits, "Wait until the pressure is reached");
  set.AddFlag("--reset", options->resets, "Reset a regulator that has tripped");
  const Arguments vent = AddPressureCommand(pressure, "vent", "Close the valve and vent the skin at once",
                                            options, selected, VentSkin);
  vent.AddOption("link", options->link, "Name of the link").Required();
  vent.AddFlag("--reset", options->resets, "Reset a regulator that has tripped");
}

}  // namespace taclink::command

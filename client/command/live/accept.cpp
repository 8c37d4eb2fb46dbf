#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>

#include "client/command/cli/commands.h"
#include "client/command/live/accept_report.h"
#include "client/command/live/accept_trials.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/acceptance.h"
#include "sensing/acceptance/acceptance_plan.h"
#include "sensing/core/read_file.h"

namespace taclink::command {
namespace {

constexpr double kNewtonsPerGram = 9.80665e-3;

struct AcceptOptions {
  std::string server = "127.0.0.1:50051";
  std::string link, plan = "quick", report, csv;
  std::optional<double> weight_g;
  PersonOptions person;
  bool play = false, show = false, discard = false, finish = false, restart = false, json = false;
};

// A shipped plan by its name, a file by its content, so that the server needs no access to it.
Result<v1::StartAcceptanceRequest> StartRequest(const AcceptOptions& options) {
  v1::StartAcceptanceRequest request;
  request.set_link(options.link);
  request.set_restart(options.restart);
  if (!ShippedPlanText(options.plan).empty()) {
    request.set_plan(options.plan);
    return request;
  }
  const auto plan = LoadAcceptancePlan(options.plan);
  if (!plan) return plan.error();
  const auto text = ReadFile(options.plan);
  if (!text) return text.error();
  request.set_plan_text(*text);
  return request;
}

Result<v1::Link> FindLink(client::Client& connection, const std::string& name) {
  const auto arm = connection.GetArm();
  if (!arm) return arm.error();
  for (const v1::Link& link : arm->links())
    if (link.name() == name) return link;
  return Error{ErrorCode::kNotFound, "the server has no link '" + name + "'; see taclink list"};
}

Result<v1::Acceptance> Measure(client::Client& connection, client::Acceptances& calls,
                               const AcceptOptions& options) {
  const auto link = FindLink(connection, options.link);
  if (!link) return link.error();
  if (options.play && link->source().kind() != v1::SOURCE_KIND_SIMULATED)
    return Error{ErrorCode::kFailedPrecondition,
                 "--play is for simulated links; '" + options.link + "' is not"};
  const auto request = StartRequest(options);
  if (!request) return request.error();
  auto started = calls.Start(*request);
  if (!started) return started.error();
  if (started->report().measured() > 0)
    fmt::print("Resuming: {} of {} trials are measured\n", started->report().measured(),
               started->trials_size());
  PersonOptions person = options.person;
  if (options.weight_g) person.force_n = kNewtonsPerGram * *options.weight_g;
  const auto trial_operator =
      options.play ? Result(MakePlayer(connection, *link, person.force_n)) : MakePerson(person);
  if (!trial_operator) return trial_operator.error();
  return MeasureTrials(calls, *std::move(started), **trial_operator);
}

Result<void> RunAccept(const AcceptOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  client::Acceptances calls = connection->AcceptanceCalls();
  if (!options.show && !options.discard && !options.finish) {
    if (const auto measured = Measure(*connection, calls, options); !measured) return measured.error();
  }
  v1::GetAcceptanceRequest get;
  get.set_link(options.link);
  v1::FinishAcceptanceRequest finish;
  finish.set_link(options.link);
  finish.set_discard(options.discard);
  const auto acceptance = options.show ? calls.Get(get) : calls.Finish(finish);
  if (!acceptance) return acceptance.error();
  if (options.discard) {
    fmt::print("{}: the acceptance under way is discarded\n", options.link);
    return {};
  }
  PrintAcceptance(*acceptance, options.json);
  if (auto saved = SaveReport(calls, options.link, options.report, options.csv); !saved) return saved;
  if (options.show || acceptance->report().verdict() != v1::ACCEPTANCE_VERDICT_FAILED) return {};
  return Error{ErrorCode::kFailedPrecondition, "link '" + options.link + "' does not meet the plan's limits"};
}

}  // namespace

void AddAccept(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<AcceptOptions>();
  const Arguments command =
      app.AddCommand("accept", "Compare a link with known loads, and report how accurate it is");
  AddServerOption(command, options->server);
  command.AddOption("link", options->link, "Name of the link").Required();
  command.AddOption("--plan", options->plan, "Shipped plan (quick, full) or a file: taclink show plan quick")
      .ShowDefault();
  const Option weight =
      command.AddOption("--weight", options->weight_g, "The weight in use, g, in place of the plan's force")
          .Must(Positive());
  const Option gauge =
      command
          .AddOption("--gauge", options->person.gauge,
                     "Serial line of a force gauge that sends a number a line; it tells the force")
          .Excludes(weight);
  command.AddOption("--gauge-baud", options->person.gauge_baud, "Rate of that line")
      .Needs(gauge)
      .ShowDefault();
  command.AddOption("--gauge-n-per-unit", options->person.gauge_n_per_unit, "Newtons per unit of the gauge")
      .Needs(gauge)
      .ShowDefault();
  const Option play =
      command.AddFlag("--play", options->play, "Let the simulation press: for simulated links");
  command.AddOption("--report", options->report, "Also write the report as an HTML page here");
  command.AddOption("--csv", options->csv, "Also write the trials as CSV here");
  const Option show =
      command.AddFlag("--show", options->show, "Only show the acceptance as it is").Excludes(play);
  const Option finish = command.AddFlag("--finish", options->finish, "End the one under way, and report")
                            .Excludes(play)
                            .Excludes(show);
  command.AddFlag("--discard", options->discard, "Throw the one under way away")
      .Excludes(play)
      .Excludes(show)
      .Excludes(finish);
  command.AddFlag("--restart", options->restart, "Throw the one under way away, and begin anew")
      .Excludes(show)
      .Excludes(finish);
  command.AddFlag("--json", options->json, "One JSON object for the result");
  command.OnChosen([options, &selected] { selected = [options] { return RunAccept(*options); }; });
}

}  // namespace taclink::command

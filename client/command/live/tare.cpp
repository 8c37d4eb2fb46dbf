#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "client/command/cli/units.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"

namespace taclink::command {
namespace {

struct TareOptions {
  std::string server = "127.0.0.1:50051";
  std::vector<std::string> links;
  bool force = false, undo = false;
  int frames = 10;
  bool json = false;
};

void PrintText(const v1::TareResponse& response) {
  for (const v1::LinkTare& link : response.links()) {
    if (!link.accepted()) {
      fmt::print("{}: refused: {}\n", link.link(), link.reason());
      continue;
    }
    if (link.undone()) {
      fmt::print("{}: the last tare is undone, which had moved the baseline by {:.3f} mm\n", link.link(),
                 link.shift_m() * kMmPerMetre);
      continue;
    }
    fmt::print("{}: tared{} over {} frames; {:.3f} mm off the baseline before, which was {:.0f} s old\n",
               link.link(), link.forced() ? " by force" : "", link.frames(), link.shift_m() * kMmPerMetre,
               link.previous_age_s());
  }
}

void PrintTareJson(const v1::TareResponse& response) {
  Json list = Json::array();
  for (const v1::LinkTare& link : response.links()) {
    list.push_back({{"link", link.link()},
                    {"accepted", link.accepted()},
                    {"reason", link.reason()},
                    {"forced", link.forced()},
                    {"undone", link.undone()},
                    {"frames", link.frames()},
                    {"shift_mm", link.shift_m() * kMmPerMetre},
                    {"previous_age_s", link.previous_age_s()}});
  }
  fmt::print("{}\n", Json({{"links", std::move(list)}}).dump());
}

Result<void> RunTare(const TareOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  v1::TareRequest request;
  request.mutable_links()->Assign(options.links.begin(), options.links.end());
  request.set_force(options.force);
  request.set_undo(options.undo);
  request.set_frames(static_cast<uint32_t>(options.frames));
  const auto response = connection->Tare(request);
  if (!response) return response.error();
  const auto& links = response->links();
  if (options.json) {
    PrintTareJson(*response);
  } else {
    PrintText(*response);
  }
  const auto refused = std::count_if(links.begin(), links.end(), [](const auto& l) { return !l.accepted(); });
  if (refused == 0) return {};
  return Error{
      ErrorCode::kFailedPrecondition,
      fmt::format("{} of {} links refused; their baselines are as they were", refused, links.size())};
}

}  // namespace

void AddTare(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<TareOptions>();
  const Arguments command = app.AddCommand(
      "tare", "Take what links of a server show now as their untouched skins; nothing may touch them");
  AddServerOption(command, options->server);
  command.AddOption("links", options->links, "Names of links (all)");
  command.AddFlag("--force", options->force, "Even while touched, moved or with few markers");
  command.AddFlag("--undo", options->undo, "Undo the last tare instead");
  command.AddOption("--frames", options->frames, "To average over").Must(Within(1, 300)).ShowDefault();
  command.AddFlag("--json", options->json, "One JSON object");
  command.OnChosen([options, &selected] { selected = [options] { return RunTare(*options); }; });
}

}  // namespace taclink::command

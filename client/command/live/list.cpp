#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <vector>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "client/command/live/accept_report.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"
#include "sensing/core/marker_text.h"
#include "sensing/core/printable.h"
#include "sensing/core/utc_time.h"

namespace taclink::command {
namespace {

struct ListOptions {
  std::string server = "127.0.0.1:50051";
  bool json = false;
};

std::string Milliseconds(double seconds) {
  return seconds > 0 ? fmt::format("{:.1f}", seconds * 1e3) : "-";
}

void PrintTable(const v1::Arm& arm) {
  size_t width = 4;
  for (const auto& link : arm.links()) width = std::max(width, link.name().size());
  fmt::print("{:<{}}  {:<11}  {:>7}  {:>6}  {:>6}  {:>6}  {:>8}  {}\n", "LINK", width, "STATE", "RATE/s",
             "P50 ms", "P99 ms", "AGE ms", "CONTACTS", "REASON");
  for (const auto& link : arm.links()) {
    const v1::LinkStatistics& statistics = link.statistics();
    fmt::print("{:<{}}  {:<11}  {:>7.1f}  {:>6}  {:>6}  {:>6}  {:>8}  {}\n", Printable(link.name()), width,
               client::Name(link.status()), statistics.rate_hz(), Milliseconds(statistics.latency_p50_s()),
               Milliseconds(statistics.latency_p99_s()), Milliseconds(statistics.frame_age_s()),
               statistics.contacts(), link.status_reason().empty() ? "-" : Printable(link.status_reason()));
  }
}

void PrintCameras(const v1::Arm& arm) {
  size_t width = 4;
  bool any = false;
  for (const auto& link : arm.links()) {
    width = std::max(width, link.name().size());
    any = any || !link.cameras().empty();
  }
  if (!any) return;
  fmt::print("\n{:<{}}  {:<6}  {:<14}  {:>6}  {:>8}  {:>6}  {:>7}  {:>6}  {:>8}  {}\n", "LINK", width,
             "CAMERA", "FORMAT", "RATE/s", "PICTURES", "LOST", "DAMAGED", "UNREAD", "UNPAIRED", "DEVICE");
  for (const auto& link : arm.links()) {
    for (const auto& camera : link.cameras()) {
      fmt::print("{:<{}}  {:<6}  {:<14}  {:>6.1f}  {:>8}  {:>6}  {:>7}  {:>6}  {:>8}  {}\n",
                 Printable(link.name()), width, Printable(camera.name()),
                 camera.format().empty() ? "-" : Printable(camera.format()), camera.rate_hz(),
                 camera.pictures(), camera.lost(), camera.damaged(), camera.undecodable(), camera.unpaired(),
                 Printable(camera.trouble().empty() ? camera.device() : camera.trouble()));
    }
  }
}

// What is gone for good, once a link.
void PrintMissingMarkers(const v1::Arm& arm) {
  for (const auto& link : arm.links()) {
    const auto& missing = link.baseline().missing_markers();
    if (missing.empty() || link.model().markers().paths() == 0) continue;
    const std::vector<int> markers(missing.begin(), missing.end());
    fmt::print("\n{}: no camera shows the markers on {}; forces near them are less accurate\n",
               Printable(link.name()), MarkerText(markers, static_cast<int>(link.model().markers().paths())));
  }
}

// How old a calibration is that was not made with the baseline itself.
void PrintCalibrations(const v1::Arm& arm) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const int64_t now_s = std::chrono::duration_cast<std::chrono::seconds>(now).count();
  for (const auto& link : arm.links()) {
    const int64_t made_s = link.baseline().calibrated_utc_ns() / 1'000'000'000;
    if (made_s == 0 || link.baseline().calibrated_utc_ns() == link.baseline().taken_utc_ns()) continue;
    constexpr double kDayS = 86400;
    fmt::print("\n{}: cameras calibrated {}, {:.1f} days ago\n", Printable(link.name()), UtcText(made_s),
               static_cast<double>(now_s - made_s) / kDayS);
  }
}

// How good each link was in its last acceptance.
void PrintAcceptances(const v1::Arm& arm) {
  for (const auto& link : arm.links()) {
    const std::string text = AcceptanceText(link);
    if (!text.empty()) fmt::print("\n{}: acceptance {}\n", Printable(link.name()), text);
  }
}

Json AcceptanceJson(const v1::Link& link) {
  if (!link.has_acceptance()) return nullptr;
  const v1::AcceptanceSummary& summary = link.acceptance();
  Json out = {{"verdict", client::Name(summary.verdict())},
              {"finished_utc_ns", summary.finished_utc_ns()},
              {"loads", summary.loads()},
              {"findings", std::vector<std::string>(summary.findings().begin(), summary.findings().end())},
              {"outdated", summary.outdated()}};
  if (summary.has_force_bias()) out["force_bias"] = summary.force_bias();
  if (summary.has_force_bias_half_width()) out["force_bias_half_width"] = summary.force_bias_half_width();
  if (summary.has_force_error_95()) out["force_error_95"] = summary.force_error_95();
  if (summary.has_place_error_95_m()) out["place_error_95_mm"] = summary.place_error_95_m() * 1e3;
  return out;
}

Json CameraJson(const v1::Camera& camera) {
  Json out = {{"camera", camera.name()},       {"configured", camera.configured()},
              {"device", camera.device()},     {"format", camera.format()},
              {"trouble", camera.trouble()},   {"rate_hz", camera.rate_hz()},
              {"pictures", camera.pictures()}, {"lost", camera.lost()},
              {"damaged", camera.damaged()},   {"undecodable", camera.undecodable()},
              {"unpaired", camera.unpaired()}, {"stamped_on_arrival", camera.stamped_on_arrival()}};
  if (camera.has_automatic_exposure()) out["automatic_exposure"] = camera.automatic_exposure();
  if (camera.has_exposure_s()) out["exposure_ms"] = camera.exposure_s() * 1e3;
  if (camera.has_gain()) out["gain"] = camera.gain();
  return out;
}

Json ListedLinkJson(const v1::Link& link) {
  Json cameras = Json::array();
  for (const auto& camera : link.cameras()) cameras.push_back(CameraJson(camera));
  const v1::LinkStatistics& statistics = link.statistics();
  return {{"link", link.name()},
          {"model", link.model().name()},
          {"source", client::Name(link.source().kind())},
          {"source_description", link.source().description()},
          {"state", client::Name(link.status())},
          {"reason", link.status_reason()},
          {"rate_hz", statistics.rate_hz()},
          {"latency_p50_ms", statistics.latency_p50_s() * 1e3},
          {"latency_p99_ms", statistics.latency_p99_s() * 1e3},
          {"frame_age_ms", statistics.frame_age_s() * 1e3},
          {"contacts", statistics.contacts()},
          {"frames", statistics.frames()},
          {"frames_skipped", statistics.frames_skipped()},
          {"source_restarts", statistics.source_restarts()},
          {"supervision", client::Name(link.supervision())},
          {"worker_restarts", statistics.worker_restarts()},
          {"stage_overruns", statistics.stage_overruns()},
          {"workers_abandoned", statistics.workers_abandoned()},
          {"last_failure", statistics.last_failure()},
          {"pairs_skipped", statistics.pairs_skipped()},
          {"missing_markers", std::vector<uint32_t>(link.baseline().missing_markers().begin(),
                                                    link.baseline().missing_markers().end())},
          {"calibrated_utc_ns", link.baseline().calibrated_utc_ns()},
          {"acceptance", AcceptanceJson(link)},
          {"cameras", std::move(cameras)}};
}

void PrintArmJson(const v1::Arm& arm) {
  Json links = Json::array();
  for (const auto& link : arm.links()) links.push_back(ListedLinkJson(link));
  const Json json = {
      {"arm", arm.name()}, {"server_version", arm.server_version()}, {"links", std::move(links)}};
  fmt::print("{}\n", json.dump());
}

Result<void> RunList(const ListOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  const auto arm = connection->GetArm();
  if (!arm) return arm.error();
  if (options.json) {
    PrintArmJson(*arm);
  } else {
    PrintTable(*arm);
    PrintCameras(*arm);
    PrintMissingMarkers(*arm);
    PrintCalibrations(*arm);
    PrintAcceptances(*arm);
  }
  return {};
}

}  // namespace

void AddList(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<ListOptions>();
  const Arguments command = app.AddCommand("list", "Show the links of a server");
  AddServerOption(command, options->server);
  command.AddFlag("--json", options->json, "One JSON object");
  command.OnChosen([options, &selected] { selected = [options] { return RunList(*options); }; });
}

}  // namespace taclink::command

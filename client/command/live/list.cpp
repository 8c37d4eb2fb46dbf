#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "client/command/live/connect.h"
#include "client/cpp/taclink/client.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

struct ListOptions {
  std::string server = "127.0.0.1:50051";
  bool json = false;
};

std::string Milliseconds(double seconds) {
  return seconds > 0 ? fmt::format("{:.1f}", seconds * 1e3) : "-";
}

void PrintTable(const client::Arm& arm) {
  size_t width = 4;
  for (const auto& link : arm.links) width = std::max(width, link.name.size());
  fmt::print("{:<{}}  {:<11}  {:>7}  {:>6}  {:>6}  {:>8}  {}\n", "LINK", width, "STATE", "RATE/s", "P50 ms",
             "P99 ms", "CONTACTS", "REASON");
  for (const auto& link : arm.links) {
    fmt::print("{:<{}}  {:<11}  {:>7.1f}  {:>6}  {:>6}  {:>8}  {}\n", Printable(link.name), width,
               client::Name(link.status), link.rate_hz, Milliseconds(link.latency_p50_s),
               Milliseconds(link.latency_p99_s), link.contacts,
               link.status_reason.empty() ? "-" : Printable(link.status_reason));
  }
}

void PrintCameras(const client::Arm& arm) {
  size_t width = 4;
  bool any = false;
  for (const auto& link : arm.links) {
    width = std::max(width, link.name.size());
    any = any || !link.cameras.empty();
  }
  if (!any) return;
  fmt::print("\n{:<{}}  {:<6}  {:<14}  {:>6}  {:>8}  {:>6}  {:>7}  {:>6}  {:>8}  {}\n", "LINK", width,
             "CAMERA", "FORMAT", "RATE/s", "PICTURES", "LOST", "DAMAGED", "UNREAD", "UNPAIRED", "DEVICE");
  for (const auto& link : arm.links) {
    for (const auto& camera : link.cameras) {
      fmt::print("{:<{}}  {:<6}  {:<14}  {:>6.1f}  {:>8}  {:>6}  {:>7}  {:>6}  {:>8}  {}\n",
                 Printable(link.name), width, Printable(camera.name),
                 camera.format.empty() ? "-" : Printable(camera.format), camera.rate_hz, camera.pictures,
                 camera.lost, camera.damaged, camera.undecodable, camera.unpaired,
                 Printable(camera.trouble.empty() ? camera.device : camera.trouble));
    }
  }
}

Json CameraJson(const client::Camera& camera) {
  Json out = {{"camera", camera.name},       {"configured", camera.configured},
              {"device", camera.device},     {"format", camera.format},
              {"trouble", camera.trouble},   {"rate_hz", camera.rate_hz},
              {"pictures", camera.pictures}, {"lost", camera.lost},
              {"damaged", camera.damaged},   {"undecodable", camera.undecodable},
              {"unpaired", camera.unpaired}, {"stamped_on_arrival", camera.stamped_on_arrival}};
  if (camera.automatic_exposure) out["automatic_exposure"] = *camera.automatic_exposure;
  if (camera.exposure_s) out["exposure_ms"] = *camera.exposure_s * 1e3;
  if (camera.gain) out["gain"] = *camera.gain;
  return out;
}

void PrintArmJson(const client::Arm& arm) {
  Json links = Json::array();
  for (const auto& link : arm.links) {
    Json cameras = Json::array();
    for (const auto& camera : link.cameras) cameras.push_back(CameraJson(camera));
    links.push_back({{"link", link.name},
                     {"model", link.model.name},
                     {"source", client::Name(link.source)},
                     {"source_description", link.source_description},
                     {"state", client::Name(link.status)},
                     {"reason", link.status_reason},
                     {"rate_hz", link.rate_hz},
                     {"latency_p50_ms", link.latency_p50_s * 1e3},
                     {"latency_p99_ms", link.latency_p99_s * 1e3},
                     {"contacts", link.contacts},
                     {"frames", link.frames},
                     {"frames_skipped", link.frames_skipped},
                     {"source_restarts", link.source_restarts},
                     {"supervision", client::Name(link.supervision)},
                     {"worker_restarts", link.worker_restarts},
                     {"stage_overruns", link.stage_overruns},
                     {"workers_abandoned", link.workers_abandoned},
                     {"last_failure", link.last_failure},
                     {"pairs_skipped", link.pairs_skipped},
                     {"cameras", std::move(cameras)}});
  }
  const Json json = {{"arm", arm.name}, {"server_version", arm.server_version}, {"links", std::move(links)}};
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

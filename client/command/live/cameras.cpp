#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "sensing/capture/camera_finder.h"
#include "sensing/capture/v4l2_offers.h"

namespace taclink::command {
namespace {

struct CamerasOptions {
  bool json = false;
};

/// Of a camera that may be in use: looking disturbs nobody. `trouble`: why nothing can be said.
std::vector<CameraOffer> Offers(const FoundCamera& camera, std::string& trouble) {
  const int fd = open(camera.node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) {
    trouble = errno == EACCES ? "no permission; add the user to the device's group ('video')"
                              : std::strerror(errno);
    return {};
  }
  auto offers = ListOffers(fd);
  close(fd);
  return offers;
}

void PrintText(const std::vector<FoundCamera>& cameras) {
  if (cameras.empty()) fmt::print("no cameras\n");
  for (const FoundCamera& camera : cameras) {
    std::string trouble;
    fmt::print("{}\n", Describe(camera));
    for (const CameraOffer& offer : Offers(camera, trouble)) {
      if (!offer.readable) continue;
      fmt::print("  {:<5} {:<10} {}\n", offer.format, offer.size,
                 offer.rates.empty() ? "" : offer.rates + " per second");
    }
    if (!trouble.empty()) fmt::print("  {}\n", trouble);
  }
}

void PrintCamerasJson(const std::vector<FoundCamera>& cameras) {
  Json list = Json::array();
  for (const FoundCamera& camera : cameras) {
    std::string trouble;
    Json offers = Json::array();
    for (const CameraOffer& offer : Offers(camera, trouble)) {
      offers.push_back({{"format", offer.format},
                        {"readable", offer.readable},
                        {"size", offer.size},
                        {"rates_hz", offer.rates}});
    }
    list.push_back({{"node", camera.node},
                    {"name", camera.name},
                    {"usb_path", camera.usb_path},
                    {"serial", camera.serial},
                    {"offers", std::move(offers)},
                    {"trouble", trouble}});
  }
  fmt::print("{}\n", list.dump());
}

}  // namespace

void AddCameras(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<CamerasOptions>();
  const Arguments command =
      app.AddCommand("cameras", "List this machine's cameras, as the configuration can name them");
  command.AddFlag("--json", options->json, "One JSON list");
  command.OnChosen([options, &selected] {
    selected = [options]() -> Result<void> {
      const auto cameras = ListCameras();
      options->json ? PrintCamerasJson(cameras) : PrintText(cameras);
      return {};
    };
  });
}

}  // namespace taclink::command

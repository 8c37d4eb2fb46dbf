#include "server/assembly/source_factory.h"

#include "sensing/capture/file_source.h"
#include "sensing/capture/v4l2_source.h"
#include "sensing/simulation/scene.h"

namespace taclink::server {
namespace {

using SourceResult = Result<std::unique_ptr<FrameSource>>;

struct SourceMaker {
  const LinkModel& model;
  Clock& clock;
  const HandlingNow& handling;

  SourceResult operator()(const V4l2SourceConfig& config) const {
    return MakeV4l2Source({.devices = config.devices,
                           .width_px = config.width_px,
                           .height_px = config.height_px,
                           .frame_rate_hz = config.frame_rate_hz,
                           .format = config.format,
                           .exposure_100us = config.exposure_100us,
                           .gain = config.gain},
                          clock);
  }

  SourceResult operator()(const FileSourceConfig& config) const {
    return MakeFileSource({.folder = config.folder,
                           .frame_rate_hz = config.frame_rate_hz,
                           .loop = config.loop,
                           .paced = true,
                           .start_after_s = config.start_after_s,
                           .in_memory = config.in_memory,
                           .yuyv = config.yuyv},
                          clock);
  }

  SourceResult operator()(const SimulatedSourceConfig& config) const {
    const auto scene = LoadScene(config.scene);
    if (!scene) return scene.error();
    return MakeSimulatedSource(model, *scene, clock, config.pace, handling);
  }
};

}  // namespace

SourceResult MakeSource(const LinkConfig& link, const LinkModel& model, Clock& clock, HandlingNow handling) {
  return std::visit(SourceMaker{model, clock, handling}, link.source);
}

}  // namespace taclink::server

#include "server/assembly/processor_factory.h"

#include <memory>

#include "sensing/camera/calibration.h"
#include "sensing/pipeline/link_pipeline.h"

namespace taclink::server {
namespace {

constexpr double kMpaPerKpa = 1e-3;

}  // namespace

Result<FrameProcessor> MakeProcessor(const LinkConfig& link, const LinkModel& model) {
  PipelineOptions options;
  if (link.pressure_kpa) options.pressure_mpa = *link.pressure_kpa * kMpaPerKpa;
  if (link.calibration) {
    auto rig = LoadCalibration(*link.calibration, model);
    if (!rig) return rig.error();
    options.rig = *rig;
  }
  auto pipeline = std::make_shared<LinkPipeline>(model, options);
  return FrameProcessor(
      [pipeline](const StereoFrame& frame, LinkState& state) { pipeline->Process(frame, state); });
}

}  // namespace taclink::server

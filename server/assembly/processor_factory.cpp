#include "server/assembly/processor_factory.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <utility>

#include "sensing/camera/calibration_file.h"
#include "sensing/core/units.h"
#include "server/assembly/pipeline_processor.h"

namespace taclink::server {
namespace {

constexpr double kMpaPerPa = 1e-6;

bool IsMissing(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::status(path, ignored).type() == std::filesystem::file_type::not_found;
}

CalibrationIdentity IdentityOf(const LinkConfig& link) {
  CalibrationIdentity identity{.link = link.name};
  if (const auto* cameras = std::get_if<V4l2SourceConfig>(&link.source)) identity.devices = cameras->devices;
  return identity;
}

}  // namespace

PipelineOptions ToPipelineOptions(const LinkConfig& link) {
  PipelineOptions options;
  options.force.model = link.force_model;
  options.force.refinement = link.force_refinement;
  options.force.most_work = FrameWork::kLiveUnits;
  options.drift = link.drift;
  options.pictures_may_repeat = !std::holds_alternative<V4l2SourceConfig>(link.source);
  if (link.pressure) {
    if (const auto* constant = std::get_if<ConstantPressureConfig>(&link.pressure->source))
      options.pressure_mpa = constant->kpa * kMpaPerKpa;
    if (link.pressure->sigma_pa) options.pressure_sigma_mpa = *link.pressure->sigma_pa * kMpaPerPa;
  }
  return options;
}

Result<std::unique_ptr<LinkProcessor>> MakeProcessor(const LinkConfig& link, const LinkModel& model) {
  PipelineOptions options = ToPipelineOptions(link);
  if (link.calibration && IsMissing(*link.calibration)) {
    SPDLOG_WARN(
        "link {}: {} does not exist yet; the first pictures calibrate the cameras instead. "
        "'taclink calibrate --link {} --save' writes it",
        link.name, *link.calibration, link.name);
  } else if (link.calibration) {
    const auto saved = LoadCalibration(*link.calibration, model, IdentityOf(link));
    if (!saved) return saved.error();
    options.rig = saved->rig;
    options.calibrated_utc_s = saved->identity.made_utc_s;
  }
  return std::unique_ptr<LinkProcessor>(
      std::make_unique<PipelineProcessor>(model, options, link.calibration, IdentityOf(link)));
}

}  // namespace taclink::server

#include "server/assembly/log_preamble.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <array>

#include "sensing/core/read_file.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/options_text.h"
#include "server/assembly/processor_factory.h"
#include "wire/log/topics.h"

namespace taclink::server {
namespace {

constexpr const char* kYaml = "application/yaml";

std::string HostName() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

void AddFile(const std::string& name, const char* media_type, const std::string& path, LogPreamble& out) {
  auto text = ReadFile(path);
  if (text) {
    out.files.push_back({name, media_type, *std::move(text)});
  } else {
    SPDLOG_WARN("recording: {}; logs will not hold it", text.error().message);
  }
}

}  // namespace

LogPreamble MakePreamble(const Config& config, const std::string& version) {
  LogPreamble out;
  out.metadata[wire::log::kMetadataName] = {
      {"format", "1"},
      {"server_version", version},
      {"host", HostName()},
      {"arm", config.arm_name},
      {"clock", "log times are UTC, ns since 1970-01-01, of the server's machine"}};
  out.files.push_back({wire::log::kConfigAttachment, kYaml, ConfigText(config)});
  for (const LinkConfig& link : config.links) {
    out.metadata[wire::log::LinkMetadataName(link.name)] = OptionsText(ToPipelineOptions(link));
    if (const auto text = LinkModelText(link.model))
      out.files.push_back({wire::log::ModelAttachment(link.name), kYaml, *text});
    if (link.calibration) AddFile(wire::log::CalibrationAttachment(link.name), kYaml, *link.calibration, out);
  }
  if (config.kinematics.urdf)
    AddFile(wire::log::kUrdfAttachment, "application/xml", *config.kinematics.urdf, out);
  return out;
}

}  // namespace taclink::server

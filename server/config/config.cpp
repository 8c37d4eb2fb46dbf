#include "server/config/config.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <span>

#include "sensing/core/embedded_file.h"
#include "sensing/core/name.h"
#include "sensing/core/read_file.h"
#include "sensing/yaml/yaml_reader.h"
#include "server/config/config_drift.h"
#include "server/config/config_events.h"
#include "server/config/config_names.h"
#include "server/config/config_watchdog.h"

namespace taclink {
std::span<const EmbeddedFile> EmbeddedConfigs();
}

namespace taclink::server {
namespace {

constexpr Range kPixels{.min = 16, .max = 16384};
constexpr Range kFrameRate{.min = 0.01, .max = 1000};
constexpr Range kStartAfter{.min = 0, .max = 3600};
constexpr double kLongestArmMm = 1e5;

struct Reader {
  std::string folder;
  RealtimeOptions realtime = {};  // for all links

  std::string Path(const std::string& path) const {
    return (std::filesystem::path(folder) / path).lexically_normal().string();
  }
  // Models and scenes: a bare word names a shipped one.
  std::string NameOrPath(const std::string& text) const {
    const bool path =
        text.find('/') != std::string::npos || text.ends_with(".yaml") || text.ends_with(".yml");
    return path ? Path(text) : text;
  }

  SourceConfig ReadSource(YamlMap& link) const;
  LinkConfig ReadLink(YamlMap link) const;
};

V4l2SourceConfig ReadV4l2(YamlMap& link) {
  V4l2SourceConfig config;
  const auto devices = link.Texts("devices");
  if (devices.size() == kCameraCount) {
    std::copy(devices.begin(), devices.end(), config.devices.begin());
    for (const std::string& device : devices) {
      const bool good = device.starts_with("/") || (device.starts_with("usb:") && device.size() > 4) ||
                        (device.starts_with("serial:") && device.size() > 7);
      if (!good)
        link.Fail("devices", "must be device paths, usb:1-2.3 or serial:NUMBER, not '" + device + "'");
    }
  } else {
    link.Fail("devices", "must be a list of two cameras, the top and the bottom one");
  }
  config.width_px = link.Integer("width_px", config.width_px, kPixels);
  config.height_px = link.Integer("height_px", config.height_px, kPixels);
  config.frame_rate_hz = link.Number("frame_rate_hz", config.frame_rate_hz, kFrameRate);
  const size_t format = link.Choice("format", {kFormatNames.begin(), kFormatNames.end()}, 0);
  if (format > 0) config.format = kCameraFormats[format - 1];
  if (link.Has("exposure_100us")) config.exposure_100us = link.Integer("exposure_100us", {.min = 1});
  if (link.Has("gain")) config.gain = link.Integer("gain", kNotNegative);
  return config;
}

SourceConfig Reader::ReadSource(YamlMap& link) const {
  switch (link.Choice("source", {kSourceNames.begin(), kSourceNames.end()})) {
    case 0:
      return ReadV4l2(link);
    case 1: {
      FileSourceConfig config;
      config.folder = Path(link.Text("folder"));
      config.frame_rate_hz = link.Number("frame_rate_hz", config.frame_rate_hz, kFrameRate);
      config.loop = link.Bool("loop", config.loop);
      if (link.Has("start_after_s")) config.start_after_s = link.Number("start_after_s", 0, kStartAfter);
      config.in_memory = link.Bool("in_memory", config.in_memory);
      config.yuyv = link.Bool("yuyv", config.yuyv);
      return config;
    }
    default:
      return SimulatedSourceConfig{
          .scene = NameOrPath(link.Text("scene")),
          .pace = static_cast<ScenePace>(link.Choice("pace", {kPaceNames.begin(), kPaceNames.end()}, 0))};
  }
}

std::string ReadName(YamlMap& map) {
  std::string name = map.Text("name");
  if (const auto good = CheckName(name); !good && map.Has("name")) map.Fail("name", good.error().message);
  return name;
}

bool MayBeInflated(const LinkConfig& link) {
  if (!link.pressure) return false;
  const auto* constant = std::get_if<ConstantPressureConfig>(&link.pressure->source);
  return constant == nullptr || constant->kpa != 0;
}

void ReadForceModel(YamlMap& link, LinkConfig& config) {
  if (link.Has("force_model")) {
    const size_t model = link.Choice("force_model", {kForceModelNames.begin(), kForceModelNames.end()});
    config.force_model = model == 0 ? std::nullopt : std::optional<ForceModel>(kForceModels[model - 1]);
  }
  config.force_model_anyway = link.Bool("force_model_anyway", false);
  if (const auto good = CheckForceModel(config); !good) link.Fail("force_model", good.error().message);
  config.force_refinement = link.Integer("force_refinement", config.force_refinement, {.min = 0, .max = 3});
}

LinkConfig Reader::ReadLink(YamlMap link) const {
  LinkConfig config;
  config.name = ReadName(link);
  config.model = NameOrPath(link.Text("model"));
  config.source = ReadSource(link);
  if (link.Has("calibration")) config.calibration = Path(link.Text("calibration"));
  config.pressure = ReadPressure(link, std::holds_alternative<SimulatedSourceConfig>(config.source), folder);
  ReadForceModel(link, config);
  config.drift = ReadDrift(link);
  config.rules = ReadRules(link);
  if (YamlMap pose = link.Map("pose"); link.Has("pose")) {
    config.frame = pose.Text("frame", "");
    const auto position = pose.Numbers("position_mm", 3, {.min = -kLongestArmMm, .max = kLongestArmMm});
    std::copy_n(position.begin(), 3, config.position_mm.begin());
    if (pose.Has("rotation_deg")) {
      const auto rotation = pose.Numbers("rotation_deg", 3, {.min = -360, .max = 360});
      std::copy_n(rotation.begin(), 3, config.rotation_deg.begin());
    }
    pose.Done();
  }
  config.realtime = ReadRealtime(link, realtime);
  link.Done();
  return config;
}

void ReadServer(YamlMap& root, Config& config) {
  YamlMap server = root.Map("server");
  config.listen = server.Text("listen", config.listen);
  if (const auto good = CheckListenAddress(config.listen); !good) server.Fail("listen", good.error().message);
  server.Done();
  config.limits = ReadLimits(root);
}

void ReadArm(YamlMap& root, const Reader& reader, Config& config) {
  YamlMap arm = root.Map("arm");
  config.arm_name = ReadName(arm);
  config.kinematics = ReadKinematics(arm, reader.folder);
  std::set<std::string> names;
  std::vector<YamlMap> links = arm.Maps("links");
  if (links.size() > static_cast<size_t>(config.limits.max_links)) {
    arm.Fail("links", "has " + std::to_string(links.size()) + ", more than limits.max_links, which is " +
                          std::to_string(config.limits.max_links) +
                          "; each takes some 100 MB, so these some " +
                          std::to_string((links.size() + 9) / 10) + " GB: raise it where there is that much");
    links.clear();
  }
  for (YamlMap& link : links) {
    config.links.push_back(reader.ReadLink(link));
    if (!config.links.back().frame.empty() && !config.kinematics.urdf)
      link.Fail("pose", "has a 'frame', so the arm must have a 'urdf' that holds it");
    if (!names.insert(config.links.back().name).second) link.Fail("name", "is used by another link");
  }
  if (config.links.empty()) arm.Fail("links", "must name at least one link");
  arm.Done();
}

}  // namespace

Result<void> CheckForceModel(const LinkConfig& link, bool is_inflated) {
  if (link.force_model != ForceModel::kLinear || link.force_model_anyway) return {};
  if (!is_inflated && !MayBeInflated(link)) return {};
  return Error{
      ErrorCode::kFailedPrecondition,
      "is 'linear', which does not hold on an inflated skin, and the link has a pressure: choose 'auto', "
      "or say 'force_model_anyway: true'"};
}

Result<Config> ParseConfig(const std::string& name, std::string_view text, const std::string& folder) {
  auto file = YamlFile::Parse(name, text);
  if (!file) return file.error();
  YamlMap& root = file->root();
  const int version = root.Integer("taclink_config");
  if (version != kConfigVersion) root.Fail("taclink_config", "must be 1, the version of this format");
  Config config;
  ReadServer(root, config);
  config.log = ReadLog(root);
  config.shutdown = ReadShutdown(root);
  config.watchdog = ReadWatchdog(root);
  config.realtime = ReadRealtime(root, {});
  const Reader reader{folder, config.realtime};
  const auto path = [&reader](const std::string& relative) { return reader.Path(relative); };
  config.http = ReadHttp(root, path);
  config.security = ReadSecurity(root, path);
  config.events = ReadEvents(root, folder);
  config.recording = ReadRecording(root, path);
  config.publish = ReadPublish(root, path);
  ReadArm(root, reader, config);
  root.Done();
  if (const auto finished = file->Finish(); !finished) return finished.error();
  return config;
}

Result<Config> LoadConfig(const std::string& path) {
  const auto text = ReadFile(path);
  if (!text) return text.error();
  return ParseConfig(path, *text, std::filesystem::absolute(path).parent_path().string());
}

std::string_view DemoConfigText() {
  return EmbeddedConfigs().front().content;
}

Result<Config> DemoConfig() {
  return ParseConfig("demo.yaml", DemoConfigText(), "");
}

Rigid3 LinkConfig::FrameFromLink() const {
  const auto about = [this](size_t axis, const Vec3& unit) {
    return Eigen::AngleAxisd(RadFromDeg(rotation_deg[axis]), unit);
  };
  const Mat3 rotation =
      (about(2, Vec3::UnitZ()) * about(1, Vec3::UnitY()) * about(0, Vec3::UnitX())).toRotationMatrix();
  return {rotation, Vec3(position_mm[0], position_mm[1], position_mm[2])};
}

}  // namespace taclink::server

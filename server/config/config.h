#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/frame.h"
#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/pipeline/drift_options.h"
#include "sensing/simulation/scene_pace.h"
#include "server/config/options.h"
#include "server/config/regulator_options.h"

namespace taclink::server {

inline constexpr Range kPressureKpa{-100, 100}, kSpecificForce{-100, 100}, kFrameRates{0.01, 1000},
    kNoLimits{};

struct ConstantPressureConfig {  ///< configured, not measured
  double kpa = 0;                ///< gauge
  void Describe(FieldVisitor& visit) { visit(Required("kpa"), kpa, kPressureKpa, "Gauge pressure."); }
};
struct SimulatedPressureConfig {};  ///< the simulation's
struct FilePressureConfig {
  std::string path;
  void Describe(FieldVisitor& visit) { visit.Path(Required("path"), path, "File or named pipe."); }
};
struct SerialPressureConfig {
  std::string device;
  int baud = 9600;
  void Describe(FieldVisitor& visit) {
    visit.Path(Required("device"), device, "Serial line.");
    visit("baud", baud, kNoLimits, "Rate of the line, a usual one from 1200 to 921600.");
    visit.Check(std::ranges::find(kBaudRates, baud) != kBaudRates.end(), "baud",
                "must be a usual rate from 1200 to 921600, as 9600");
  }
};
struct ClientPressureConfig {};  ///< clients send it by UpdatePressure

/// Where the gauge pressure inside a link's skin comes from.
struct PressureConfig {
  std::variant<ConstantPressureConfig, SimulatedPressureConfig, FilePressureConfig, SerialPressureConfig,
               ClientPressureConfig, RegulatorPressureConfig>
      source;
  double kpa_per_unit = 1, offset_kpa = 0;  ///< kPa = kpa_per_unit * number + offset_kpa
  double stale_after_s = 1;                 ///< of sensors
  std::optional<double> sigma_pa = {};      ///< none: PressureSigma
  void Describe(FieldVisitor& visit) {
    const Names names = {"constant", "simulated", "file", "serial", "grpc", "regulator"};
    visit.Variant(Required("source"), source, names, "Origin.", [this](FieldVisitor& fields, size_t kind) {
      if (kind == 2 || kind == 3) {  // file, serial
        fields("kpa_per_unit", kpa_per_unit, kNoLimits, "Factor of the numbers read.");
        fields.Check(kpa_per_unit != 0, "kpa_per_unit", "must not be 0");
        fields("offset_kpa", offset_kpa, kNoLimits, "Added to the product.");
      }
      // Without readings for so long a regulator vents the skin.
      const Range stale_s = kind == 5 ? Range{0.1, 2} : Range{0.01, 3600};
      if (kind >= 2) fields("stale_after_s", stale_after_s, stale_s, "An older reading is not used.");
    });
    visit("sigma_pa", sigma_pa, {0.1, 1e5}, "Standard deviation; not set: as is usual for the source.");
  }
};

struct FixedGravityConfig {};  ///< the link never moves
struct ConstantGravityConfig {
  std::array<double, 3> mps2{};
  void Describe(FieldVisitor& visit) {
    visit(Required("mps2"), mps2, kSpecificForce, "Where things fall, in the link's frame, with 9.81.");
  }
};
struct JointGravityConfig {};  ///< by the arm's URDF and joint states
struct ClientGravityConfig {   ///< clients send it by UpdateAttitude
  std::chrono::milliseconds stale_after{200};
  void Describe(FieldVisitor& visit) {
    visit("stale_after_s", stale_after, {0.01, 3600}, "A reading farther from an exposure is not used.");
  }
};
struct UnknownGravityConfig {};  ///< the skin tells it

/// Where the specific force in a link's frame comes from, under which its skin sags.
struct GravityConfig {
  std::variant<FixedGravityConfig, ConstantGravityConfig, JointGravityConfig, ClientGravityConfig,
               UnknownGravityConfig>
      source;
  double sigma_mps2 = 0.2;
  void Describe(FieldVisitor& visit) {
    const Names names = {"fixed", "constant", "joint_states", "grpc", "unknown"};
    visit.Variant(Required("source"), source, names, "Origin.", [this](FieldVisitor& fields, size_t kind) {
      if (kind >= 1 && kind <= 3)
        fields("sigma_mps2", sigma_mps2, {0.001, 100}, "Standard deviation of each component.");
    });
  }
};

struct V4l2SourceConfig {
  std::array<std::string, kCameraCount> devices;
  int width_px = 640, height_px = 480;
  double frame_rate_hz = 30;
  std::optional<PixelFormat> format;
  std::optional<int> exposure_100us, gain;
  void Describe(FieldVisitor& visit) {
    visit(Required("devices"), devices, "two cameras, the top and the bottom one",
          "Top and bottom camera: a path, usb:1-2.3 or serial:NUMBER.");
    for (const std::string& device : devices)
      visit.Check(device.starts_with("/") || (device.starts_with("usb:") && device.size() > 4) ||
                      (device.starts_with("serial:") && device.size() > 7),
                  "devices", "must be device paths, usb:1-2.3 or serial:NUMBER, not '" + device + "'");
    visit("width_px", width_px, {16, 16384}, "Width of the images.");
    visit("height_px", height_px, {16, 16384}, "Height of the images.");
    visit("frame_rate_hz", frame_rate_hz, kFrameRates, "Frame rate.");
    constexpr PixelFormat kFormats[] = {PixelFormat::kYuyv, PixelFormat::kMjpeg, PixelFormat::kGray8};
    visit.Choice("format", format, {"auto", "yuyv", "mjpeg", "grey"}, kFormats, "`auto`: the best there is.");
    visit("exposure_100us", exposure_100us, {.min = 1}, "Exposure; not set: the camera decides.");
    visit("gain", gain, kNotNegative, "Gain, in the camera's own unit; not set: the camera decides.");
  }
};

struct FileSourceConfig {
  std::string folder;
  double frame_rate_hz = 30;
  bool loop = true;
  std::optional<double> start_after_s = {};
  bool in_memory = false, yuyv = false;
  void Describe(FieldVisitor& visit) {
    visit.Path(Required("folder"), folder, "Folder of the images.");
    visit("frame_rate_hz", frame_rate_hz, kFrameRates, "Frame rate.");
    visit("loop", loop, "Begin again after the last image.");
    visit("start_after_s", start_after_s, {0, 3600}, "After a full second of the clock; not set: at once.");
    visit("in_memory", in_memory, "Read the images once, at the start.");
    visit("yuyv", yuyv, "Convert gray images to YUYV, as from a camera.");
  }
};

struct SimulatedSourceConfig {
  std::string scene;
  ScenePace pace = ScenePace::kFrames;
  void Describe(FieldVisitor& visit) {
    visit.NameOrPath(Required("scene"), scene, "Name of a shipped scene, or path.");
    visit.Choice("pace", pace, {"frames", "clock"}, "Slow machines slow down, or skip frames.");
  }
};

using SourceConfig = std::variant<V4l2SourceConfig, FileSourceConfig, SimulatedSourceConfig>;

struct LinkConfig {
  std::string name, model;
  SourceConfig source;
  std::optional<std::string> calibration;
  std::optional<PressureConfig> pressure;  ///< none: the source's, or unknown
  std::optional<GravityConfig> gravity;    ///< none: the source's; of a jointed arm joint states, else fixed
  std::optional<ForceModel> force_model;   ///< none: the cheapest that is accurate enough, frame by frame
  bool force_model_anyway = false;
  int force_refinement = 0;
  LinkRules rules;
  std::optional<DriftOptions> drift = DriftOptions{};  ///< none: the baseline does not follow
  std::string frame;
  std::array<double, 3> position_mm{}, rotation_deg{};
  RealtimeOptions realtime = {};
  Rigid3 FrameFromLink() const;
  void Describe(FieldVisitor& visit);
};

/// Whether the link's force model holds on it. The error's message follows the model's name or key.
/// Errors: kFailedPrecondition (`linear` on a skin that may be inflated, by the scene if `is_inflated`).
Result<void> CheckForceModel(const LinkConfig& link, bool is_inflated = false);

/// Errors: kInvalidArgument (a region outside the model's grid; thresholds).
Result<void> CheckRules(const LinkRules& rules, const MarkerGrid& grid);

/// All settings of `taclinkd`. Paths are usable as they stand.
struct Config {
  std::string listen = "127.0.0.1:50051";  ///< host:port, [ip6]:port or unix:path; port 0: any free one
  LimitsConfig limits;
  WatchdogOptions watchdog;
  LogOptions log;
  ShutdownConfig shutdown;
  RealtimeOptions realtime;  ///< of links that do not say it themselves
  HttpConfig http;
  SecurityConfig security;
  EventOptions events;
  RecordingConfig recording;
  AcceptanceConfig acceptance;
  PublishConfig publish;
  std::string arm_name;
  KinematicsConfig kinematics;
  std::vector<LinkConfig> links;
  void Describe(FieldVisitor& visit);
};

/// Errors: kNotFound, kInvalidArgument with a line for each error: file, line and what was expected.
Result<Config> LoadConfig(const std::string& path);
/// `name` stands for the file in messages; relative paths in the text are relative to `folder`.
Result<Config> ParseConfig(const std::string& name, std::string_view text, const std::string& folder);
/// The simulated arm that runs when there is no file.
Result<Config> DemoConfig();

/// As a file that reads back to the same.
std::string ConfigText(const Config& config);
/// JSON schema of the file.
std::string ConfigSchema();
/// docs/configuration.md.
std::string ConfigReference();

}  // namespace taclink::server

#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/frame.h"
#include "sensing/core/geometry.h"
#include "sensing/core/result.h"
#include "sensing/pipeline/drift_options.h"
#include "sensing/simulation/scene_pace.h"
#include "server/config/config_http.h"
#include "server/config/config_kinematics.h"
#include "server/config/config_limits.h"
#include "server/config/config_operations.h"
#include "server/config/config_pressure.h"
#include "server/config/config_publish.h"
#include "server/config/config_recording.h"
#include "server/config/config_security.h"
#include "server/config/event_options.h"
#include "server/config/realtime_options.h"
#include "server/config/watchdog_options.h"

namespace taclink::server {

struct V4l2SourceConfig {
  std::array<std::string, kCameraCount> devices;  ///< top, bottom: a path, usb:1-2.3 or serial:NUMBER
  int width_px = 640;
  int height_px = 480;
  double frame_rate_hz = 30;
  std::optional<PixelFormat> format;  ///< none: the best that the cameras have at that size and rate
  std::optional<int> exposure_100us;  ///< none: the camera decides
  std::optional<int> gain;
};

struct FileSourceConfig {
  std::string folder;
  double frame_rate_hz = 30;
  bool loop = true;
  std::optional<double> start_after_s = {};  ///< a full second of the machine's clock; none: at once
  bool in_memory = false;                    ///< pictures are read once, at the start
  bool yuyv = false;                         ///< gray pictures come as YUYV, as from a camera
};

struct SimulatedSourceConfig {
  std::string scene;  ///< name of a shipped one or path
  ScenePace pace = ScenePace::kFrames;
};

using SourceConfig = std::variant<V4l2SourceConfig, FileSourceConfig, SimulatedSourceConfig>;

struct LinkConfig {
  std::string name;
  std::string model;  ///< name of a shipped one or path
  SourceConfig source;
  std::optional<std::string> calibration;  ///< path; none: from the first rest picture
  std::optional<PressureConfig> pressure;  ///< none: the source's, or nobody tells it
  std::optional<ForceModel> force_model;   ///< none: the cheapest that is good enough, frame by frame
  bool force_model_anyway = false;         ///< `linear` though the skin is inflated, for comparison
  int force_refinement =
      0;  ///< elements per interval of the marker grid, 1 to 3; 0: what the model does best with
  LinkRules rules;
  std::optional<DriftOptions> drift = DriftOptions{};  ///< none: the baseline does not follow
  std::string frame;                    ///< link of the URDF that the pose is relative to; empty: the base
  std::array<double, 3> position_mm{};  ///< of the link frame's origin in that frame
  /// Roll, pitch, yaw about that frame's fixed x, y, z, applied in this order (as in URDF).
  std::array<double, 3> rotation_deg{};

  RealtimeOptions realtime = {};

  Rigid3 FrameFromLink() const;
};

/// All that `taclinkd` is told. Paths are usable as they stand.
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
  PublishConfig publish;
  std::string arm_name;
  KinematicsConfig kinematics;
  std::vector<LinkConfig> links;
};

/// Errors: kNotFound, kInvalidArgument with file, line and what was expected.
Result<Config> LoadConfig(const std::string& path);
/// `name` stands for the file in messages; relative paths in the text are relative to `folder`.
Result<Config> ParseConfig(const std::string& name, std::string_view text, const std::string& folder);
/// The simulated arm that runs when there is no file.
Result<Config> DemoConfig();
std::string_view DemoConfigText();

/// As a file that reads back to the same.
std::string ConfigText(const Config& config);

/// Whether the link's force model holds on it. The error's message follows the model's name or key.
/// Errors: kFailedPrecondition (`linear` on a skin that may be inflated).
/// `is_inflated`: by what is simulated.
Result<void> CheckForceModel(const LinkConfig& link, bool is_inflated = false);

/// Errors: kInvalidArgument (no such form of address).
Result<void> CheckListenAddress(const std::string& address);
/// Whether only this machine can connect there.
bool IsLoopback(const std::string& address);

}  // namespace taclink::server

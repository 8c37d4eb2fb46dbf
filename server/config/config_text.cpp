#include <algorithm>
#include <sstream>

#include "server/config/config.h"
#include "server/config/config_drift.h"
#include "server/config/config_events.h"
#include "server/config/config_names.h"
#include "server/config/config_watchdog.h"

namespace taclink::server {

std::string Quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

namespace {

std::string List(const std::array<double, 3>& values) {
  std::ostringstream out;
  out.precision(12);
  out << "[" << values[0] << ", " << values[1] << ", " << values[2] << "]";
  return out.str();
}

std::string_view FormatWord(const std::optional<PixelFormat>& format) {
  if (!format) return kFormatNames[0];
  const auto at = std::find(kCameraFormats.begin(), kCameraFormats.end(), *format);
  return kFormatNames[static_cast<size_t>(at - kCameraFormats.begin()) + 1];
}

struct SourceWriter {
  std::ostringstream& out;

  void operator()(const V4l2SourceConfig& v4l2) const {
    out << "      devices: [" << Quoted(v4l2.devices[0]) << ", " << Quoted(v4l2.devices[1]) << "]\n"
        << "      width_px: " << v4l2.width_px << "\n      height_px: " << v4l2.height_px << "\n"
        << "      frame_rate_hz: " << v4l2.frame_rate_hz << "\n"
        << "      format: " << FormatWord(v4l2.format) << "\n";
    if (v4l2.exposure_100us) out << "      exposure_100us: " << *v4l2.exposure_100us << "\n";
    if (v4l2.gain) out << "      gain: " << *v4l2.gain << "\n";
  }
  void operator()(const FileSourceConfig& files) const {
    out << "      folder: " << Quoted(files.folder) << "\n      frame_rate_hz: " << files.frame_rate_hz
        << "\n"
        << "      loop: " << (files.loop ? "true" : "false") << "\n";
    if (files.start_after_s) out << "      start_after_s: " << *files.start_after_s << "\n";
    out << "      in_memory: " << (files.in_memory ? "true" : "false") << "\n"
        << "      yuyv: " << (files.yuyv ? "true" : "false") << "\n";
  }
  void operator()(const SimulatedSourceConfig& simulated) const {
    out << "      scene: " << Quoted(simulated.scene) << "\n"
        << "      pace: " << kPaceNames[static_cast<size_t>(simulated.pace)] << "\n";
  }
};

}  // namespace

std::string ConfigText(const Config& config) {
  std::ostringstream out;
  out.precision(12);
  out << "taclink_config: " << kConfigVersion << "\n"
      << "server:\n  listen: " << Quoted(config.listen) << "\n"
      << LimitsText(config.limits) << HttpText(config.http) << SecurityText(config.security)
      << EventsText(config.events);
  WriteRecording(out, config.recording);
  WritePublish(out, config.publish);
  WriteLog(out, config.log);
  WriteShutdown(out, config.shutdown);
  WriteWatchdog(out, config.watchdog);
  WriteRealtime(out, "", config.realtime);
  out << "arm:\n  name: " << Quoted(config.arm_name) << "\n"
      << KinematicsText(config.kinematics) << "  links:\n";
  for (const LinkConfig& link : config.links) {
    out << "    - name: " << Quoted(link.name) << "\n      model: " << Quoted(link.model) << "\n"
        << "      source: " << kSourceNames[link.source.index()] << "\n";
    std::visit(SourceWriter{out}, link.source);
    if (link.calibration) out << "      calibration: " << Quoted(*link.calibration) << "\n";
    out << PressureText(link.pressure);
    out << "      force_model: " << (link.force_model ? Name(*link.force_model) : "auto") << "\n";
    if (link.force_model_anyway) out << "      force_model_anyway: true\n";
    out << "      force_refinement: " << link.force_refinement << "\n";
    out << DriftText(link.drift) << RulesText(link.rules);
    out << "      pose: {";
    if (!link.frame.empty()) out << "frame: " << Quoted(link.frame) << ", ";
    out << "position_mm: " << List(link.position_mm) << ", rotation_deg: " << List(link.rotation_deg)
        << "}\n";
    WriteRealtime(out, "      ", link.realtime);
  }
  return out.str();
}

}  // namespace taclink::server

#include <sstream>

#include "server/config.h"
#include "server/config_names.h"

namespace taclink::server {
namespace {

// Always quoted: a name like "1" or "no" must stay a text.
std::string Quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

std::string List(const std::array<double, 3>& values) {
  std::ostringstream out;
  out.precision(12);
  out << "[" << values[0] << ", " << values[1] << ", " << values[2] << "]";
  return out.str();
}

struct SourceWriter {
  std::ostringstream& out;

  void operator()(const V4l2SourceConfig& v4l2) const {
    out << "      devices: [" << Quoted(v4l2.devices[0]) << ", " << Quoted(v4l2.devices[1]) << "]\n"
        << "      width_px: " << v4l2.width_px << "\n      height_px: " << v4l2.height_px << "\n"
        << "      frame_rate_hz: " << v4l2.frame_rate_hz << "\n"
        << "      format: " << kFormatNames[v4l2.format == PixelFormat::kMjpeg ? 1 : 0] << "\n";
    if (v4l2.exposure_100us) out << "      exposure_100us: " << *v4l2.exposure_100us << "\n";
    if (v4l2.gain) out << "      gain: " << *v4l2.gain << "\n";
  }
  void operator()(const FileSourceConfig& files) const {
    out << "      folder: " << Quoted(files.folder) << "\n      frame_rate_hz: " << files.frame_rate_hz
        << "\n"
        << "      loop: " << (files.loop ? "true" : "false") << "\n";
  }
  void operator()(const SimulatedSourceConfig& simulated) const {
    out << "      scene: " << Quoted(simulated.scene) << "\n";
  }
};

}  // namespace

std::string ConfigText(const Config& config) {
  std::ostringstream out;
  out.precision(12);
  out << "taclink_config: " << kConfigVersion << "\n"
      << "server:\n  listen: " << Quoted(config.listen) << "\n"
      << "limits:\n  max_streams: " << config.limits.max_streams
      << "\n  queue_messages: " << config.limits.queue_messages << "\n"
      << "arm:\n  name: " << Quoted(config.arm_name) << "\n  links:\n";
  for (const LinkConfig& link : config.links) {
    out << "    - name: " << Quoted(link.name) << "\n      model: " << Quoted(link.model) << "\n"
        << "      source: " << kSourceNames[link.source.index()] << "\n";
    std::visit(SourceWriter{out}, link.source);
    if (link.calibration) out << "      calibration: " << Quoted(*link.calibration) << "\n";
    if (link.pressure_kpa) out << "      pressure_kpa: " << *link.pressure_kpa << "\n";
    out << "      force_model: " << (link.force_model ? Name(*link.force_model) : "auto") << "\n";
    out << "      force_refinement: " << link.force_refinement << "\n";
    out << "      pose: {position_mm: " << List(link.position_mm)
        << ", rotation_deg: " << List(link.rotation_deg) << "}\n";
  }
  return out.str();
}

}  // namespace taclink::server

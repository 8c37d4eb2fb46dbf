#pragma once

#include <array>
#include <optional>
#include <string>
#include <variant>

namespace taclink {
class YamlMap;
}

namespace taclink::server {

/// What a serial line may be set to.
inline constexpr std::array kBaudRates = {1200,  2400,  4800,   9600,   19200,
                                          38400, 57600, 115200, 230400, 921600};

/// Configured, not measured.
struct ConstantPressureConfig {
  double kpa = 0;  ///< gauge
};
/// What the source of the pictures says: the simulation's.
struct SimulatedPressureConfig {};
struct FilePressureConfig {
  std::string path;  ///< file or named pipe
};
struct SerialPressureConfig {
  std::string device;
  int baud = 9600;
};
/// Clients tell it by UpdatePressure.
struct ClientPressureConfig {};

/// Where the gauge pressure inside a link's skin comes from.
struct PressureConfig {
  std::variant<ConstantPressureConfig, SimulatedPressureConfig, FilePressureConfig, SerialPressureConfig,
               ClientPressureConfig>
      source;
  double kpa_per_unit = 1;  ///< of files and serial lines: kPa = kpa_per_unit * number + offset_kpa
  double offset_kpa = 0;
  double stale_after_s = 1;  ///< of sensors: an older reading is not used
  /// Standard deviation of the pressure; none: as is usual for the source (PressureSigma).
  std::optional<double> sigma_pa = {};
};

/// Reads a link's 'pressure', or its short form 'pressure_kpa'; none: the picture source's, or 0.
/// `simulated`: the link's pictures are. Relative paths are relative to `folder`.
std::optional<PressureConfig> ReadPressure(YamlMap& link, bool simulated, const std::string& folder);
/// A line of the link's mapping that reads back to the same; empty for none.
std::string PressureText(const std::optional<PressureConfig>& config);

}  // namespace taclink::server

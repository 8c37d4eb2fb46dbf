#include "server/config/config_pressure.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>
#include <string_view>

#include "sensing/yaml/yaml_reader.h"
#include "server/config/config_names.h"

namespace taclink::server {
namespace {

constexpr Range kKpa{.min = -100, .max = 100};
// As PressureConfig::source.
constexpr std::array<std::string_view, 5> kNames = {"constant", "simulated", "file", "serial", "grpc"};

std::string Path(YamlMap& map, const std::string& key, const std::string& folder) {
  const std::string path = map.Text(key);
  if (path.empty() && map.Has(key)) map.Fail(key, "must be a path");
  return (std::filesystem::path(folder) / path).lexically_normal().string();
}

void ReadSource(YamlMap& map, bool simulated, const std::string& folder, PressureConfig& config) {
  switch (map.Choice("source", {kNames.begin(), kNames.end()})) {
    case 0:
      config.source = ConstantPressureConfig{map.Number("kpa", kKpa)};
      break;
    case 1:
      config.source = SimulatedPressureConfig{};
      if (!simulated) map.Fail("source", "can only be 'simulated' where the link's source is");
      break;
    case 2:
      config.source = FilePressureConfig{Path(map, "path", folder)};
      break;
    case 3: {
      SerialPressureConfig serial{.device = Path(map, "device", folder)};
      serial.baud = map.Integer("baud", serial.baud);
      if (std::ranges::find(kBaudRates, serial.baud) == kBaudRates.end())
        map.Fail("baud", "must be a usual rate from 1200 to 921600, as 9600");
      config.source = serial;
      break;
    }
    default:
      config.source = ClientPressureConfig{};
  }
}

struct Writer {
  std::ostream& out;
  void operator()(const ConstantPressureConfig& constant) const { out << ", kpa: " << constant.kpa; }
  void operator()(const SimulatedPressureConfig&) const {}
  void operator()(const FilePressureConfig& file) const { out << ", path: " << Quoted(file.path); }
  void operator()(const SerialPressureConfig& serial) const {
    out << ", device: " << Quoted(serial.device) << ", baud: " << serial.baud;
  }
  void operator()(const ClientPressureConfig&) const {}
};

bool HasUnits(const PressureConfig& config) {
  return std::holds_alternative<FilePressureConfig>(config.source) ||
         std::holds_alternative<SerialPressureConfig>(config.source);
}
bool IsSensor(const PressureConfig& config) {
  return HasUnits(config) || std::holds_alternative<ClientPressureConfig>(config.source);
}

}  // namespace

std::optional<PressureConfig> ReadPressure(YamlMap& link, bool simulated, const std::string& folder) {
  PressureConfig config;
  if (link.Has("pressure_kpa")) {
    if (link.Has("pressure"))
      link.Fail("pressure_kpa", "is short for a constant 'pressure'; give one of them");
    config.source = ConstantPressureConfig{link.Number("pressure_kpa", kKpa)};
    return config;
  }
  if (!link.Has("pressure")) return std::nullopt;
  YamlMap map = link.Map("pressure");
  ReadSource(map, simulated, folder, config);
  if (HasUnits(config)) {
    config.kpa_per_unit = map.Number("kpa_per_unit", config.kpa_per_unit);
    if (config.kpa_per_unit == 0) map.Fail("kpa_per_unit", "must not be 0");
    config.offset_kpa = map.Number("offset_kpa", config.offset_kpa);
  }
  if (IsSensor(config))
    config.stale_after_s = map.Number("stale_after_s", config.stale_after_s, {.min = 0.01, .max = 3600});
  if (map.Has("sigma_pa")) config.sigma_pa = map.Number("sigma_pa", {.min = 0.1, .max = 1e5});
  map.Done();
  return config;
}

std::string PressureText(const std::optional<PressureConfig>& config) {
  if (!config) return {};
  std::ostringstream out;
  out.precision(12);
  out << "      pressure: {source: " << kNames[config->source.index()];
  std::visit(Writer{out}, config->source);
  if (HasUnits(*config))
    out << ", kpa_per_unit: " << config->kpa_per_unit << ", offset_kpa: " << config->offset_kpa;
  if (IsSensor(*config)) out << ", stale_after_s: " << config->stale_after_s;
  if (config->sigma_pa) out << ", sigma_pa: " << *config->sigma_pa;
  out << "}\n";
  return out.str();
}

}  // namespace taclink::server

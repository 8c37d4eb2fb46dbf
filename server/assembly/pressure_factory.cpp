#include "server/assembly/pressure_factory.h"

#include <cmath>
#include <utility>

#include "sensing/core/units.h"
#include "server/pressure/pressure_readers.h"
#include "server/pressure/pressure_sensor.h"

namespace taclink::server {
namespace {

struct PressureMaker {
  const std::string& link;
  const PressureConfig& config;
  Clock& clock;

  using Made = std::unique_ptr<PressureSource>;
  Made operator()(const ConstantPressureConfig& constant) const {
    return MakeAssumedPressure(constant.kpa * kMpaPerKpa);
  }
  Made operator()(const SimulatedPressureConfig&) const { return MakeAssumedPressure(std::nullopt); }
  Made operator()(const FilePressureConfig& file) const {
    return Sensor(PressureOrigin::kFile, MakeFilePressureReader(file.path, clock));
  }
  Made operator()(const SerialPressureConfig& serial) const {
    return Sensor(PressureOrigin::kSerial, MakeSerialPressureReader(serial.device, serial.baud, clock));
  }
  Made operator()(const ClientPressureConfig&) const { return Sensor(PressureOrigin::kClient, nullptr); }

  Made Sensor(PressureOrigin origin, std::unique_ptr<PressureReader> reader) const {
    PressureSensorOptions options;
    options.origin = origin;
    options.kpa_per_unit = config.kpa_per_unit;
    options.offset_kpa = config.offset_kpa;
    options.stale_after = std::chrono::milliseconds(std::llround(config.stale_after_s * 1e3));
    return std::make_unique<PressureSensor>(link, std::move(reader), options, clock);
  }
};

}  // namespace

std::unique_ptr<PressureSource> MakePressure(const LinkConfig& link, Clock& clock) {
  if (!link.pressure) return MakeAssumedPressure(std::nullopt);
  return std::visit(PressureMaker{link.name, *link.pressure, clock}, link.pressure->source);
}

}  // namespace taclink::server

#include "server/assembly/pressure_factory.h"

#include <cmath>
#include <functional>
#include <utility>

#include "sensing/core/units.h"
#include "server/pressure/pressure_controller.h"
#include "server/pressure/pressure_readers.h"
#include "server/pressure/pressure_sensor.h"
#include "server/pressure/serial_regulator.h"

namespace taclink::server {
namespace {

struct PressureMaker {
  const std::string& link;
  const PressureConfig& config;
  Clock& clock;
  std::shared_ptr<SimulatedRegulator> regulator;

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

  Made operator()(const RegulatorPressureConfig& regulated) const {
    auto actuator = regulated.device ? MakeSerialRegulator(*regulated.device, regulated.baud, clock)
                                     : MakeSimulatedActuator(regulator);
    return std::make_unique<PressureController>(link, std::move(actuator), regulated.regulator, StaleAfter(),
                                                clock);
  }

  std::chrono::milliseconds StaleAfter() const {
    return std::chrono::milliseconds(std::llround(config.stale_after_s * 1e3));
  }
  Made Sensor(PressureOrigin origin, std::unique_ptr<PressureReader> reader) const {
    PressureSensorOptions options;
    options.origin = origin;
    options.kpa_per_unit = config.kpa_per_unit;
    options.offset_kpa = config.offset_kpa;
    options.stale_after = StaleAfter();
    return std::make_unique<PressureSensor>(link, std::move(reader), options, clock);
  }
};

}  // namespace

std::shared_ptr<SimulatedRegulator> MakeSimulatedRegulator(const LinkConfig& link, Clock& clock) {
  if (!link.pressure) return nullptr;
  const auto* regulated = std::get_if<RegulatorPressureConfig>(&link.pressure->source);
  if (regulated == nullptr || regulated->device) return nullptr;
  const uint64_t seed = std::hash<std::string>()(link.name);  // noise of its own, the same in each run
  return std::make_shared<SimulatedRegulator>(regulated->simulation, seed, clock);
}

std::unique_ptr<PressureSource> MakePressure(const LinkConfig& link, Clock& clock,
                                             std::shared_ptr<SimulatedRegulator> regulator) {
  if (!link.pressure) return MakeAssumedPressure(std::nullopt);
  return std::visit(PressureMaker{link.name, *link.pressure, clock, std::move(regulator)},
                    link.pressure->source);
}

}  // namespace taclink::server

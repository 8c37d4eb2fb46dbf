#pragma once

#include <memory>
#include <string>

#include "sensing/core/clock.h"
#include "server/pressure/pressure_actuator.h"

namespace taclink::server {

/// A regulator on a serial line, 8N1, with the line protocol of docs/pressure.md: it receives "P <kPa>" and
/// "V", and sends "p <kPa> [<effort>]" and "e <text>". `baud`: of kBaudRates.
std::unique_ptr<PressureActuator> MakeSerialRegulator(std::string device, int baud, Clock& clock);

}  // namespace taclink::server

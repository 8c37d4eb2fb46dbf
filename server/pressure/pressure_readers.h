#pragma once

#include <memory>
#include <string>

#include "sensing/core/clock.h"
#include "server/pressure/pressure_sensor.h"

namespace taclink::server {

/// A file whose last line is a number (its time is that of the file's last change), or a named pipe that gets
/// a number a line.
std::unique_ptr<PressureReader> MakeFilePressureReader(std::string path, Clock& clock);

/// A serial device that sends a number a line, 8N1.
std::unique_ptr<PressureReader> MakeSerialPressureReader(std::string device, int baud, Clock& clock);

}  // namespace taclink::server

#pragma once

#include <string>

#include "sensing/core/result.h"

namespace taclink::server {

enum class SerialAccess { kRead, kReadWrite };

/// Opens a serial device in raw mode, 8N1, non-blocking, not as a controlling terminal. Returns its
/// descriptor, which the caller owns. kReadWrite opens it exclusively. `baud`: of kBaudRates. Errors:
/// kUnavailable, with the device's name.
Result<int> OpenSerialLine(const std::string& device, int baud, SerialAccess access);

}  // namespace taclink::server

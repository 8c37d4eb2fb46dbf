#pragma once

#include <string>

#include "sensing/core/result.h"

namespace taclink::server {

enum class SerialAccess { kRead, kReadWrite };

/// Opens a serial device raw, 8N1, without a controlling terminal, so that neither reads nor writes wait.
/// Returns its descriptor, which the caller owns. With kReadWrite nobody else can open the device meanwhile.
/// `baud`: of kBaudRates. Errors: kUnavailable, with the device's name.
Result<int> OpenSerialLine(const std::string& device, int baud, SerialAccess access);

}  // namespace taclink::server

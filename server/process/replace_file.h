#pragma once

#include <string>
#include <string_view>

#include "sensing/core/result.h"

namespace taclink::server {

/// Replaces a file as a whole, and makes the folders above it: a reader sees the old content or the new one,
/// also after a power failure. Waits for the disk. Errors: kUnavailable (names the file and the reason); then
/// the file is as it was.
Result<void> ReplaceFile(const std::string& path, std::string_view content);

}  // namespace taclink::server

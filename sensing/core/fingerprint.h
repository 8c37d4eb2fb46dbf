#pragma once

#include <string>
#include <string_view>

namespace taclink {

/// Tells texts apart: the first 64 bits of their SHA-256, 16 hexadecimal digits. No protection from forgery.
std::string Fingerprint(std::string_view text);

}  // namespace taclink

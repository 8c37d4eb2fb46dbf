#pragma once

#include <string>

namespace taclink {

/// A reason's text for people, by a format of printf; at most 399 characters.
[[gnu::format(printf, 1, 2)]] std::string ReasonText(const char* format, ...);

}  // namespace taclink

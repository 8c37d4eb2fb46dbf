#pragma once

#include <cstdio>
#include <string>

namespace taclink {

/// A number with `digits` significant digits (%.*g).
inline std::string Digits(double value, int digits = 3) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

/// A number with `decimals` decimals (%.*f).
inline std::string Decimals(double value, int decimals = 1) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

}  // namespace taclink

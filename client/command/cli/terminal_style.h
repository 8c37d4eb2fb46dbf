#pragma once

#include <string>
#include <string_view>

namespace taclink::command {

enum class Color { kGreen, kYellow, kRed, kOrange, kDim, kBold };

/// The text with control sequences around it that color it on a terminal.
std::string Colored(std::string_view text, Color color);

/// Whether standard output is a terminal that takes colors, and the user did not set NO_COLOR
/// (https://no-color.org).
bool WantsColor();

/// A bar of so many characters, filled in eighths; `share` from 0 to 1.
std::string Bar(double share, int characters);
/// The height of each number in one character, 0 to `top`; NaN: a gap.
template <typename Numbers>
std::string Sparkline(const Numbers& numbers, double top);
/// One character of a sparkline.
std::string_view SparkAt(double share);

template <typename Numbers>
std::string Sparkline(const Numbers& numbers, double top) {
  std::string out;
  for (const double number : numbers) out += SparkAt(number / top);
  return out;
}

}  // namespace taclink::command

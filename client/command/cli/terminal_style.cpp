#include "client/command/cli/terminal_style.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace taclink::command {
namespace {

constexpr std::array<std::string_view, 9> kHeights = {" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array<std::string_view, 9> kWidths = {"", "▏", "▎", "▍", "▌", "▋", "▊", "▉", "█"};
constexpr int kSteps = 8;  // of a character

std::string_view Code(Color color) {
  switch (color) {
    case Color::kGreen:
      return "32";
    case Color::kYellow:
      return "33";
    case Color::kRed:
      return "31";
    case Color::kOrange:
      return "38;5;208";
    case Color::kDim:
      return "2";
    case Color::kBold:
      return "1";
  }
  return "0";
}

}  // namespace

std::string Colored(std::string_view text, Color color) {
  std::string out = "\x1b[";
  out += Code(color);
  out += "m";
  out += text;
  return out += "\x1b[0m";
}

bool WantsColor() {
  // getenv is safe here: no thread of this program changes the environment.
  // NOLINTBEGIN(concurrency-mt-unsafe)
  const char* no_color = std::getenv("NO_COLOR");
  const char* terminal = std::getenv("TERM");
  // NOLINTEND(concurrency-mt-unsafe)
  return isatty(STDOUT_FILENO) == 1 && (no_color == nullptr || *no_color == 0) &&
         (terminal == nullptr || std::string_view(terminal) != "dumb");
}

std::string Bar(double share, int characters) {
  const auto steps = static_cast<int>(
      std::lround(std::clamp(std::isfinite(share) ? share : 0.0, 0.0, 1.0) * kSteps * characters));
  std::string out;
  for (int i = 0; i < steps / kSteps; ++i) out += kWidths[kSteps];
  const int rest = steps % kSteps;
  out += kWidths[static_cast<size_t>(rest)];
  const int used = steps / kSteps + (rest > 0 ? 1 : 0);
  return out + std::string(static_cast<size_t>(characters - used), ' ');
}

std::string_view SparkAt(double share) {
  if (!std::isfinite(share)) return " ";
  return kHeights[static_cast<size_t>(std::lround(std::clamp(share, 0.0, 1.0) * kSteps))];
}

}  // namespace taclink::command

#include "client/command/cli/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <utility>

namespace taclink::command {
namespace {

constexpr std::chrono::seconds kSilent{2};
constexpr std::chrono::milliseconds kPeriod{200};

}  // namespace

Progress::Progress(std::string of)
    : of_(std::move(of)), wanted_(isatty(STDERR_FILENO) == 1), next_(begun_ + kSilent) {}

Progress::~Progress() {
  if (shown_) std::fputs("\r\x1b[K", stderr);
}

void Progress::Show(double share) {
  const auto now = std::chrono::steady_clock::now();
  if (!wanted_ || !(share >= 0 && share <= 1) || now < next_) return;
  next_ = now + kPeriod;
  shown_ = true;
  const double spent_s = std::chrono::duration<double>(now - begun_).count();
  std::string left;
  if (share > 0) left = ", " + TimeLeftText(SecondsLeft(share, spent_s)) + " left";
  fmt::print(stderr, "\r{:.0f} % of {}{}\x1b[K", std::floor(100 * share), of_, left);
  std::fflush(stderr);
}

std::string TimeLeftText(double seconds) {
  const auto whole = static_cast<long long>(std::ceil(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

double SecondsLeft(double share, double spent_s) {
  return spent_s * (1 - share) / share;
}

}  // namespace taclink::command

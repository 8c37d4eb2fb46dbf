#include "server/config/event_options.h"

#include <cmath>

namespace taclink::server {
namespace {

constexpr double kMostN = 10'000;

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

}  // namespace

Result<void> CheckThresholds(const Thresholds& thresholds) {
  const auto good = [](double n) { return std::isfinite(n) && n >= 0 && n <= kMostN; };
  if (!good(thresholds.warning_n) || !good(thresholds.alarm_n) || !good(thresholds.hysteresis_n))
    return Invalid("warning_n, alarm_n and hysteresis_n must be numbers from 0 to 10000 N; 0: no such level");
  const double warning = thresholds.warning_n, alarm = thresholds.alarm_n;
  if (warning > 0 && alarm > 0 && alarm < warning) return Invalid("alarm_n must not be below warning_n");
  const double lowest = warning > 0 ? warning : alarm;
  if (lowest > 0 && thresholds.hysteresis_n >= lowest)
    return Invalid("hysteresis_n must be below the lower threshold, else a level is never left");
  return {};
}

Result<void> CheckRules(const LinkRules& rules, const MarkerGrid& grid) {
  if (auto good = CheckThresholds(rules.thresholds); !good) return good;
  for (const Region& region : rules.regions) {
    const std::string where = "region '" + region.name + "': ";
    if (auto good = CheckThresholds(region.thresholds); !good) return Invalid(where + good.error().message);
    if (region.first_ring > region.last_ring || region.last_ring >= grid.rings() || region.first_ring < 0)
      return Invalid(where + "rings must be two rising numbers from 1 to " + std::to_string(grid.rings()));
    if (region.first_path < 0 || region.last_path < 0 || region.first_path >= grid.paths ||
        region.last_path >= grid.paths)
      return Invalid(where + "paths must be two numbers from 1 to " + std::to_string(grid.paths));
  }
  return {};
}

}  // namespace taclink::server

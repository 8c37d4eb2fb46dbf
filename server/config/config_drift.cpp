#include "server/config/config_drift.h"

#include <sstream>

namespace taclink::server {

std::optional<DriftOptions> ReadDrift(YamlMap& link) {
  YamlMap map = link.Map("drift");
  DriftOptions drift;
  const bool follow = map.Bool("follow", true);
  drift.time_constant_s = map.Number("time_constant_s", drift.time_constant_s, {.min = 0.1, .max = 1e6});
  drift.rate_limit_mm_s = map.Number("rate_limit_mm_s", drift.rate_limit_mm_s, {.min = 1e-9, .max = 10});
  drift.limit_mm = map.Number("limit_mm", drift.limit_mm, {.min = 0.001, .max = 100});
  drift.stop_n = map.Number("stop_n", drift.stop_n, {.min = 0.001, .max = 100});
  drift.go_n = map.Number("go_n", drift.go_n, {.min = 0.0005, .max = 100});
  drift.quiet_s = map.Number("quiet_s", drift.quiet_s, {.min = 0.1, .max = 86400});
  if (drift.go_n >= drift.stop_n) map.Fail("go_n", "must be below stop_n");
  map.Done();
  return follow ? std::optional(drift) : std::nullopt;
}

std::string DriftText(const std::optional<DriftOptions>& drift) {
  if (!drift) return "      drift: {follow: false}\n";
  std::ostringstream out;
  out.precision(12);
  out << "      drift: {follow: true, time_constant_s: " << drift->time_constant_s
      << ", rate_limit_mm_s: " << drift->rate_limit_mm_s << ", limit_mm: " << drift->limit_mm
      << ",\n              stop_n: " << drift->stop_n << ", go_n: " << drift->go_n
      << ", quiet_s: " << drift->quiet_s << "}\n";
  return out.str();
}

}  // namespace taclink::server

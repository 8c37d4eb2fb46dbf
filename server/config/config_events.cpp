#include "server/config/config_events.h"

#include <filesystem>
#include <set>
#include <sstream>

#include "sensing/core/name.h"
#include "server/config/config_names.h"

namespace taclink::server {
namespace {

constexpr Range kForce{.min = 0, .max = 10'000};
constexpr Range kGridNumber{.min = 1, .max = 10'000};

Thresholds ReadThresholds(YamlMap& map) {
  Thresholds thresholds;
  thresholds.warning_n = map.Number("warning_n", thresholds.warning_n, kForce);
  thresholds.alarm_n = map.Number("alarm_n", thresholds.alarm_n, kForce);
  thresholds.hysteresis_n = map.Number("hysteresis_n", thresholds.hysteresis_n, kForce);
  if (const auto good = CheckThresholds(thresholds); !good)
    map.Fail("hysteresis_n", "is no good: " + good.error().message);
  return thresholds;
}

Region ReadRegion(YamlMap& map) {
  Region region;
  region.name = map.Text("name");
  if (const auto good = CheckName(region.name); !good) map.Fail("name", good.error().message);
  const auto rings = map.Integers("rings", 2, kGridNumber), paths = map.Integers("paths", 2, kGridNumber);
  region.first_ring = rings[0] - 1;
  region.last_ring = rings[1] - 1;
  region.first_path = paths[0] - 1;
  region.last_path = paths[1] - 1;
  region.thresholds = ReadThresholds(map);
  map.Done();
  return region;
}

void Write(const Thresholds& thresholds, std::ostream& out) {
  out << "warning_n: " << thresholds.warning_n << ", alarm_n: " << thresholds.alarm_n
      << ", hysteresis_n: " << thresholds.hysteresis_n;
}

}  // namespace

EventOptions ReadEvents(YamlMap& root, const std::string& folder) {
  YamlMap map = root.Map("events");
  EventOptions events;
  events.history = map.Integer("history", events.history, {.min = 1, .max = 1'000'000});
  events.begin_n = map.Number("begin_n", events.begin_n, {.min = 0.001, .max = 1000});
  events.end_n = map.Number("end_n", events.end_n, {.min = 0.001, .max = 1000});
  if (events.end_n > events.begin_n) map.Fail("end_n", "must not be above begin_n");
  events.release_s = map.Number("release_s", events.release_s, {.min = 0, .max = 60});
  events.update_rate_hz = map.Number("update_rate_hz", events.update_rate_hz, {.min = 0.001, .max = 1000});
  events.drift_step_mm = map.Number("drift_step_mm", events.drift_step_mm, {.min = 0.001, .max = 100});
  events.audit = map.Text("audit", "");
  if (!events.audit.empty())
    events.audit = (std::filesystem::path(folder) / events.audit).lexically_normal().string();
  events.audit_max_kb = map.Integer("audit_max_kb", events.audit_max_kb, {.min = 1, .max = 1'000'000});
  map.Done();
  return events;
}

LinkRules ReadRules(YamlMap& link) {
  LinkRules rules;
  YamlMap thresholds = link.Map("thresholds");
  rules.thresholds = ReadThresholds(thresholds);
  thresholds.Done();
  std::set<std::string> names;
  for (YamlMap& map : link.Maps("regions")) {
    rules.regions.push_back(ReadRegion(map));
    if (!names.insert(rules.regions.back().name).second) map.Fail("name", "is used by another region");
  }
  return rules;
}

std::string EventsText(const EventOptions& events) {
  std::ostringstream out;
  out.precision(12);
  out << "events:\n  history: " << events.history << "\n  begin_n: " << events.begin_n
      << "\n  end_n: " << events.end_n << "\n  release_s: " << events.release_s
      << "\n  update_rate_hz: " << events.update_rate_hz << "\n  drift_step_mm: " << events.drift_step_mm
      << "\n  audit: " << Quoted(events.audit) << "\n  audit_max_kb: " << events.audit_max_kb << "\n";
  return out.str();
}

std::string RulesText(const LinkRules& rules) {
  std::ostringstream out;
  out.precision(12);
  out << "      thresholds: {";
  Write(rules.thresholds, out);
  out << "}\n";
  if (!rules.regions.empty()) out << "      regions:\n";
  for (const Region& region : rules.regions) {
    out << "        - {name: " << Quoted(region.name) << ", rings: [" << region.first_ring + 1 << ", "
        << region.last_ring + 1 << "], paths: [" << region.first_path + 1 << ", " << region.last_path + 1
        << "], ";
    Write(region.thresholds, out);
    out << "}\n";
  }
  return out.str();
}

}  // namespace taclink::server

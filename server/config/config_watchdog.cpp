#include "server/config/config_watchdog.h"

#include <sched.h>

#include <algorithm>
#include <array>
#include <set>

namespace taclink::server {
namespace {

using std::chrono::milliseconds;

constexpr Range kSeconds{.min = 0.01, .max = 86400};

struct Limit {
  const char* key;
  milliseconds WatchdogOptions::* value;
};
constexpr std::array<Limit, 7> kLimits = {{{"source_start_s", &WatchdogOptions::source_start},
                                           {"source_next_s", &WatchdogOptions::source_next},
                                           {"first_frames_s", &WatchdogOptions::first_frames},
                                           {"frame_s", &WatchdogOptions::frame},
                                           {"abandon_s", &WatchdogOptions::abandon},
                                           {"build_s", &WatchdogOptions::build},
                                           {"proven_s", &WatchdogOptions::proven}}};

}  // namespace

WatchdogOptions ReadWatchdog(YamlMap& root) {
  WatchdogOptions options;
  YamlMap map = root.Map("watchdog");
  for (const Limit& limit : kLimits) {
    milliseconds& value = options.*limit.value;
    value = milliseconds(
        std::lround(1e3 * map.Number(limit.key, 1e-3 * static_cast<double>(value.count()), kSeconds)));
  }
  options.deaths = map.Integer("deaths", options.deaths, {.min = 1, .max = 1000});
  if (options.abandon < std::max({options.source_start, options.source_next, options.frame}))
    map.Fail("abandon_s",
             "must not be shorter than a stage may take: source_start_s, source_next_s, frame_s");
  map.Done();
  return options;
}

void WriteWatchdog(std::ostream& out, const WatchdogOptions& options) {
  out << "watchdog:\n";
  for (const Limit& limit : kLimits)
    out << "  " << limit.key << ": " << 1e-3 * static_cast<double>((options.*limit.value).count()) << "\n";
  out << "  deaths: " << options.deaths << "\n";
}

RealtimeOptions ReadRealtime(YamlMap& map, const RealtimeOptions& inherited) {
  RealtimeOptions options = inherited;
  YamlMap realtime = map.Map("realtime");
  options.priority = realtime.Integer("priority", options.priority, {.min = 0, .max = 99});
  if (realtime.Has("cpus")) {
    std::set<int> cpus;  // in order, each once
    for (const int cpu : realtime.Integers("cpus", 0, {.min = 0, .max = CPU_SETSIZE - 1})) cpus.insert(cpu);
    options.cpus.assign(cpus.begin(), cpus.end());
  }
  realtime.Done();
  return options;
}

void WriteRealtime(std::ostream& out, const std::string& indent, const RealtimeOptions& options) {
  out << indent << "realtime: {priority: " << options.priority << ", cpus: [";
  for (size_t i = 0; i < options.cpus.size(); ++i) out << (i > 0 ? ", " : "") << options.cpus[i];
  out << "]}\n";
}

}  // namespace taclink::server

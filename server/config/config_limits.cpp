#include "server/config/config_limits.h"

#include <array>
#include <sstream>

namespace taclink::server {
namespace {

struct Entry {
  const char* key;
  int LimitsConfig::* value;
  Range range;
};

constexpr std::array<Entry, 13> kEntries = {{
    {"max_links", &LimitsConfig::max_links, {.min = 1, .max = 10000}},
    {"max_streams", &LimitsConfig::max_streams, {.min = 1, .max = 10000}},
    {"max_streams_per_peer", &LimitsConfig::max_streams_per_peer, {.min = 1, .max = 10000}},
    {"max_calls_per_connection", &LimitsConfig::max_calls_per_connection, {.min = 1, .max = 10000}},
    {"max_message_kb", &LimitsConfig::max_message_kb, {.min = 1, .max = 65536}},
    {"memory_mb", &LimitsConfig::memory_mb, {.min = 16, .max = 65536}},
    {"queue_messages", &LimitsConfig::queue_messages, {.min = 1, .max = 100000}},
    {"queue_mb", &LimitsConfig::queue_mb, {.min = 1, .max = 65536}},
    {"queue_mb_per_peer", &LimitsConfig::queue_mb_per_peer, {.min = 1, .max = 65536}},
    {"keepalive_s", &LimitsConfig::keepalive_s, {.min = 1, .max = 86400}},
    {"keepalive_timeout_s", &LimitsConfig::keepalive_timeout_s, {.min = 1, .max = 86400}},
    {"handshake_timeout_s", &LimitsConfig::handshake_timeout_s, {.min = 1, .max = 3600}},
    {"idle_timeout_s", &LimitsConfig::idle_timeout_s, {.min = 1, .max = 86400}},
}};

}  // namespace

LimitsConfig ReadLimits(YamlMap& root) {
  LimitsConfig limits;
  YamlMap map = root.Map("limits");
  for (const Entry& entry : kEntries)
    limits.*entry.value = map.Integer(entry.key, limits.*entry.value, entry.range);
  map.Done();
  return limits;
}

std::string LimitsText(const LimitsConfig& limits) {
  std::ostringstream out;
  out << "limits:\n";
  for (const Entry& entry : kEntries) out << "  " << entry.key << ": " << limits.*entry.value << "\n";
  return out.str();
}

}  // namespace taclink::server

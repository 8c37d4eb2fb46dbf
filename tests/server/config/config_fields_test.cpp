// The one list of keys: what is read, printed and in the schema agrees.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "server/config/config.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using Json = nlohmann::json;
using Values = std::map<std::string, std::set<std::string>>;  // of every key, as JSON

// Every key, with another value than its default, at least in one link.
constexpr const char* kEverything = R"(taclink_config: 1
server: {listen: "127.0.0.1:1"}
limits: {max_links: 33, max_connections: 255, max_connections_per_peer: 63, max_streams: 3, max_streams_per_peer: 2, max_calls_per_connection: 4, max_message_kb: 65, memory_mb: 257,
  queue_messages: 5, queue_mb: 33, queue_mb_per_peer: 65, keepalive_s: 7, keepalive_timeout_s: 8, handshake_timeout_s: 9,
  idle_timeout_s: 10, max_frame_age_s: 0.25}
http: {listen: "", web_root: /web, max_connections: 7, max_connections_per_peer: 5, header_timeout_s: 1.5, idle_timeout_s: 2.5,
  write_timeout_s: 3.5}
security: {certificate: /s.pem, key: /s.key, client_ca: /c.pem, tokens: /tokens, tokens_on_error: keep, tokens_permissions: any,
  max_failed_tries_per_minute: 3}
events: {history: 50, begin_n: 0.5, end_n: 0.4, release_s: 0.3, update_rate_hz: 2, drift_step_mm: 0.2, audit: /audit,
  audit_max_kb: 5}
recording: {folder: /logs, at_start: true, pictures: true, compression: lz4, picture_compression: zstd, split_mb: 10, split_s: 0,
  quota_mb: 100, sync_s: 0.5, queue_mb: 64, scene_rate_hz: 0}
acceptance: {folder: /accepted}
publish: {url: "nats://b:4222", site: lab, stream: all, stream_mb: 10, tls_ca: /ca.pem, certificate: /p.pem, key: /p.key,
  credentials: /u.creds, token_file: /token, frames_detail: full, frames_rate_hz: 0, contacts_deadband_n: 0.1, queue_mb: 8}
log: {level: debug, format: json, file: /log, rate_limit: 1, rate_limit_total: 2}
shutdown: {limit_s: 0.5}
watchdog: {source_start_s: 1, source_next_s: 2, first_frames_s: 3, frame_s: 4, abandon_s: 5, build_s: 6, proven_s: 7, deaths: 8}
realtime: {priority: 1, cpus: [2]}
arm:
  name: all
  urdf: /arm.urdf
  gravity_mps2: [0, 9.8, 0]
  base: floor
  joint_states: {stale_after_s: 0.5, extrapolate_s: 0.25}
  links:
    - name: a
      model: barrel
      source: v4l2
      devices: [/dev/a, "serial:B"]
      width_px: 1280
      height_px: 720
      frame_rate_hz: 60
      format: mjpeg
      exposure_100us: 50
      gain: 0
      calibration: /calibration.yaml
      gravity: {source: constant, mps2: [0, -9.8, 0], sigma_mps2: 0.5}
      pressure: {source: serial, device: /dev/c, baud: 1200, kpa_per_unit: 2, offset_kpa: 3, stale_after_s: 4, sigma_pa: 5}
      force_model: linear
      force_model_anyway: true
      force_refinement: 2
      drift: {follow: false, time_constant_s: 6, rate_limit_mm_s: 0.5, limit_mm: 7, stop_n: 0.5, go_n: 0.25, quiet_s: 8}
      thresholds: {warning_n: 0.5, alarm_n: 1.5, hysteresis_n: 0.125}
      regions:
        - {name: palm, rings: [1, 5], paths: [18, 2], warning_n: 0.25, alarm_n: 1.25, hysteresis_n: 0.0625}
      pose: {frame: wrist, position_mm: [1, 2, 3], rotation_deg: [4, 5, 6]}
      realtime: {priority: 3, cpus: [4, 5]}
    - {name: b, model: barrel, source: files, folder: /b, frame_rate_hz: 5, loop: false, start_after_s: 0.25, in_memory: true,
       yuyv: true, pressure: {source: file, path: /kpa, kpa_per_unit: 2},
       gravity: {source: grpc, stale_after_s: 2},
       drift: {time_constant_s: 6, rate_limit_mm_s: 0.5, limit_mm: 7, stop_n: 0.5, go_n: 0.25, quiet_s: 8}}
    - {name: c, model: barrel, source: simulated, scene: press, pace: clock, pressure: {source: constant, kpa: 2}}
    - {name: d, model: barrel, source: v4l2, devices: [/dev/d, /dev/e],
       pressure: {source: regulator, device: /dev/f, baud: 9600, min_kpa: 0.25, max_kpa: 1.75, ramp_kpa_s: 0.125, stale_after_s: 2,
         trips: {over_kpa: 2.25, under_kpa: -1, jump_kpa: 0.75, follow_kpa: 0.5, follow_s: 2, leak_effort: 0.25, leak_s: 5}}}
    - {name: e, model: barrel, source: simulated, scene: press, pace: clock, pressure: {source: regulator,
       simulation: {time_constant_s: 0.5, slew_kpa_s: 0.25, leak_per_s: 0.125, noise_pa: 5, offset_pa: 25, gain_error: 0.125}}}
)";

std::string TextOf(const std::string& text) {
  const auto config = ParseConfig("all.yaml", text, "/etc");
  EXPECT_TRUE(config.ok()) << config.error().message;
  return config.ok() ? ConfigText(*config) : "";
}

Json JsonOf(const YAML::Node& node) {
  Json out;
  if (node.IsMap()) {
    for (const auto& entry : node) out[entry.first.Scalar()] = JsonOf(entry.second);
  } else if (node.IsSequence()) {
    out = Json::array();
    for (const auto& item : node) out.push_back(JsonOf(item));
  } else {
    out = node.Tag() == "!" ? Json(node.Scalar()) : Json::parse(node.Scalar(), nullptr, false);
    if (out.is_discarded()) out = node.Scalar();
  }
  return out;
}

void Collect(const Json& value, const std::string& path, Values& out) {
  for (const auto& [key, item] : value.items()) {
    const std::string whole = path + (path.empty() ? "" : ".") + key;
    if (item.is_object()) {
      Collect(item, whole, out);
    } else if (item.is_array() && !item.empty() && item[0].is_object()) {
      for (const Json& one : item) Collect(one, whole + "[]", out);
    } else {
      out[whole].insert(item.dump());
    }
  }
}

// Of a schema: every key that has a value, with its default.
void CollectSchema(const Json& object, const std::string& path, Values& out) {
  if (object.contains("allOf"))
    for (const Json& one : object.at("allOf")) CollectSchema(one.at("then"), path, out);
  for (const auto& [key, given] : object.at("properties").items()) {
    const std::string whole = path + (path.empty() ? "" : ".") + key;
    const Json& property = given.contains("anyOf") ? given.at("anyOf").back() : given;
    EXPECT_FALSE(given.at("description").get<std::string>().empty()) << whole;
    if (property.at("type") == "object") {
      CollectSchema(property, whole, out);
    } else if (property.at("type") == "array" && property.at("items").at("type") == "object") {
      CollectSchema(property.at("items"), whole + "[]", out);
    } else {
      auto& defaults = out[whole];
      if (property.contains("default")) defaults.insert(property.at("default").dump());
    }
  }
}

TEST(ConfigFields, AllErrorsOfAFileAreReportedWithTheirLines) {
  const auto config = ParseConfig("arm.yaml",
                                  "taclink_config: 1\n"
                                  "limits:\n  max_streams: many\n  queue_mb: 0\n"
                                  "events: {begin_n: 0.1, end_n: 0.2}\n"
                                  "arm:\n  name: a\n  links:\n"
                                  "    - {name: b, model: cylinder, source: film, scen: press}\n"
                                  "    - {name: c, model: cylinder, source: simulated, scen: press}\n",
                                  "");
  ASSERT_FALSE(config.ok());
  const std::string& message = config.error().message;
  EXPECT_THAT(message,
              ::testing::StartsWith(
                  "arm.yaml:3: 'limits.max_streams' must be a whole number, not 'many'\n"
                  "arm.yaml:4: 'limits.queue_mb' must be at least 1 and at most 65536, not 0\n"
                  "arm.yaml:5: 'events.end_n' must not be above begin_n\n"
                  "arm.yaml:9: 'arm.links[0].source' must be one of v4l2, files, simulated, not 'film'\n"
                  "arm.yaml:9: 'arm.links[0].scen' is not a known key here; known are: "));
  EXPECT_THAT(message, HasSubstr("\narm.yaml:10: 'arm.links[1].scen' is not a known key here"));
  EXPECT_THAT(message, ::testing::EndsWith("\narm.yaml:10: 'arm.links[1].scene' is missing"));
}

TEST(ConfigFields, WhatFollowsFromAnErrorIsNotReported) {
  const auto message = [](const std::string& sections) {
    const auto config = ParseConfig(
        "arm.yaml",
        "taclink_config: 1\n" + sections +
            "arm: {name: a, links: [{name: b, model: cylinder, source: simulated, scene: press}]}\n",
        "");
    return config.ok() ? "accepted" : config.error().message;
  };
  EXPECT_THAT(message("events: {begin_n: small, end_n: 0.2}\n"), Not(HasSubstr("\n")));
  EXPECT_THAT(message("security: {certificate: [a], key: k.pem}\n"), Not(HasSubstr("\n")));
  EXPECT_THAT(message("realtime: {cpus: [a, b]}\n"), Not(HasSubstr("\n")));
  const auto version = ParseConfig("arm.yaml", "taclink_config: 2\nother: {}\n", "");
  EXPECT_EQ(version.error().message, "arm.yaml:1: 'taclink_config' must be 1, the version of this format");
}

TEST(ConfigFields, AnEmptyValueIsReportedAtItsKey) {
  const auto config =
      ParseConfig("t.yaml",
                  "taclink_config: 1\nlimits:\n  max_streams:\n\n  # a comment\n  queue_mb: 5\n"
                  "arm:\n  name: x\n  links:\n"
                  "    - {name: a, model: cylinder, source: simulated, scene: press}\n",
                  "");
  ASSERT_FALSE(config.ok());
  EXPECT_THAT(config.error().message, HasSubstr("t.yaml:3: 'limits.max_streams'"));
}

TEST(ConfigFields, NumbersReadBackToTheSameOnes) {
  const auto text = [](const std::string& limit_mm) {
    const auto config = ParseConfig("t.yaml",
                                    "taclink_config: 1\narm:\n  name: x\n  links:\n"
                                    "    - {name: a, model: cylinder, source: simulated, scene: press, "
                                    "drift: {limit_mm: " +
                                        limit_mm + ", rate_limit_mm_s: 0.00001}}\n",
                                    "");
    EXPECT_TRUE(config.ok()) << config.error().message;
    return ConfigText(*config);
  };
  EXPECT_THAT(text("0.50000000000001"), HasSubstr("limit_mm: 0.50000000000001,"));
  EXPECT_THAT(text("0.5"), HasSubstr("rate_limit_mm_s: 1.0e-05,"));
}

TEST(ConfigFields, EveryKeyIsReadAndPrinted) {
  const std::string text = TextOf(kEverything);
  EXPECT_EQ(TextOf(text), text);
  Values given, printed, schema;
  Collect(JsonOf(YAML::Load(kEverything)), "", given);
  Collect(JsonOf(YAML::Load(text)), "", printed);
  CollectSchema(Json::parse(ConfigSchema()), "", schema);
  EXPECT_EQ(schema.erase("arm.links[].pressure_kpa"), 1u) << "is printed as a pressure";
  for (const auto& [key, values] : printed) {
    ASSERT_TRUE(schema.contains(key)) << key;
    Values::mapped_type others = values;
    for (const auto& value : schema.at(key)) others.erase(value);
    EXPECT_THAT(others, Not(IsEmpty())) << key << " has its default everywhere";
    ASSERT_TRUE(given.contains(key)) << key;
    for (const auto& value : given.at(key)) EXPECT_TRUE(values.contains(value)) << key << ": " << value;
  }
  for (const auto& [key, defaults] : schema) EXPECT_TRUE(printed.contains(key)) << key << " is not printed";
}

TEST(ConfigFields, TheReferenceHasEveryKeyOfTheSchema) {
  Values schema;
  CollectSchema(Json::parse(ConfigSchema()), "", schema);
  const std::string page = ConfigReference();
  for (const auto& [key, defaults] : schema)
    EXPECT_THAT(page, HasSubstr("\n| `" + key.substr(key.rfind('.') + 1) + "` | ")) << key;
  EXPECT_THAT(page, HasSubstr("| `begin_n` | number, N | 0.001 to 1000 | `0.05` | "));
}

}  // namespace
}  // namespace taclink::server

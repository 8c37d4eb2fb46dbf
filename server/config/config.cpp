#include "server/config/config.h"

#include <cstdlib>
#include <filesystem>
#include <span>
#include <utility>

#include "sensing/core/embedded_file.h"
#include "sensing/core/read_file.h"
#include "sensing/yaml/yaml_reader.h"

namespace taclink {
std::span<const EmbeddedFile> EmbeddedConfigs();
}

namespace taclink::server {
namespace {

constexpr int kConfigVersion = 1;
constexpr const char* kVersionKey = "taclink_config";
constexpr const char* kIntroduction = R"(Every key of the configuration file of `taclinkd`. Paths are relative
to the file. `taclinkd --print-config` prints the effective configuration, `taclinkd --check-config` all errors of
a file, `taclinkd --print-schema` a JSON schema, and `taclinkd --print-config-reference` this page.)";

// Below the folder where programs keep what lasts. Empty: there is no such folder.
std::string DefaultFolder(const std::string& name) {
  const char* const state = std::getenv("XDG_STATE_HOME");
  if (state != nullptr && state[0] == '/') return std::string(state) + "/taclink/" + name;
  const char* const home = std::getenv("HOME");
  return home != nullptr && home[0] == '/' ? std::string(home) + "/.local/state/taclink/" + name : "";
}

void DescribeLinks(FieldVisitor& visit, Config& config) {
  const size_t count = visit.Count("links", config.links.size());
  if (std::cmp_greater(count, config.limits.max_links)) {
    visit.Fail("links", "has " + std::to_string(count) + ", more than limits.max_links, which is " +
                            std::to_string(config.limits.max_links) +
                            "; each takes some 100 MB, so these some " + std::to_string((count + 9) / 10) +
                            " GB: raise it where there is that much");
  }
  LinkConfig fresh;
  fresh.realtime = config.realtime;
  visit(Required("links"), config.links, fresh, "link", "At least one.",
        [&config](FieldVisitor& fields, const LinkConfig& link) {
          fields.Check(link.frame.empty() || config.kinematics.urdf, "pose",
                       "has a 'frame', so the arm must have a 'urdf' that holds it");
          fields.Check(!link.gravity || !std::holds_alternative<JointGravityConfig>(link.gravity->source) ||
                           (config.kinematics.urdf && !link.frame.empty()),
                       "gravity", "by joint states needs the arm's 'urdf' and the link's pose.frame",
                       {"pose"});
        });
  visit.Check(!config.links.empty(), "links", "must name at least one link");
}

}  // namespace

void Config::Describe(FieldVisitor& visit) {
  int version = kConfigVersion;
  visit(Required(kVersionKey), version, {kConfigVersion, kConfigVersion}, "Version of this format.");
  visit.Map("server", "The gRPC server.", [this](FieldVisitor& fields) {
    fields("listen", listen, "host:port, [ip6]:port or unix:path; port 0: any free one.", CheckListenAddress);
  });
  visit("limits", limits, "What clients may cost: more is refused or dropped. SIGHUP applies changes.");
  visit("http", http, "The web page, gRPC-Web, metrics and health.");
  visit("security", security, "Files that guard the server, read again when they change; empty: none.");
  visit("events", events, "Events of contacts, and the audit trail.");
  visit("recording", recording, "Recordings of the links (docs/logs.md).");
  visit("acceptance", acceptance, "Acceptances of the links (docs/acceptance.md).");
  if (visit.Wants("publish", !publish.url.empty()))
    visit(Shorthand("publish", "url"), publish, "Data for a NATS server with JetStream (docs/fleet.md).");
  visit("log", log, "The server's log; SIGHUP applies changes and opens the file again.");
  visit("shutdown", shutdown, "The end of the server.");
  visit("watchdog", watchdog, "Supervision of the links' threads.");
  visit("realtime", realtime, "How the links' threads run; needs CAP_SYS_NICE or LimitRTPRIO.");
  visit.Map(Required("arm"), "The arm and its links.", [this](FieldVisitor& fields) {
    fields(Required("name"), arm_name, "Name of the arm.", CheckName);
    kinematics.Describe(fields);
    DescribeLinks(fields, *this);
  });
}

Result<Config> ParseConfig(const std::string& name, std::string_view text, const std::string& folder) {
  auto file = YamlFile::Parse(name, text);
  if (!file) return file.error();
  YamlMap& root = file->root();
  if (root.Has(kVersionKey) && root.Integer(kVersionKey) != kConfigVersion) {
    root.Fail(kVersionKey, "must be 1, the version of this format");
    return file->Finish().error();  // another version's keys mean something else
  }
  Config config;
  config.recording.folder = DefaultFolder("logs");
  config.acceptance.folder = DefaultFolder("acceptance");
  ReadFields(root, folder, [&](FieldVisitor& visit) { config.Describe(visit); });
  if (const auto finished = file->Finish(); !finished) return finished.error();
  return config;
}

Result<Config> LoadConfig(const std::string& path) {
  const auto text = ReadFile(path);
  if (!text) return text.error();
  return ParseConfig(path, *text, std::filesystem::absolute(path).parent_path().string());
}

Result<Config> DemoConfig() {
  return ParseConfig("demo.yaml", EmbeddedConfigs().front().content, "");
}

std::string ConfigText(const Config& config) {
  return FieldsText(FieldsOf(config));
}

std::string ConfigSchema() {
  return FieldsSchema("Configuration of taclinkd", FieldsOf(Config{}));
}

std::string ConfigReference() {
  return FieldsReference("Configuration", kIntroduction, FieldsOf(Config{}));
}

}  // namespace taclink::server

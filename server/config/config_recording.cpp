#include "server/config/config_recording.h"

#include <array>
#include <cstdlib>
#include <vector>

#include "server/config/config_names.h"

namespace taclink::server {
namespace {

using mcap::Compression;

struct Choice {
  const char* name;
  Compression compression;
};
constexpr std::array<Choice, 3> kChoices = {
    {{"none", Compression::kNone}, {"zstd", Compression::kZstd}, {"lz4", Compression::kLz4}}};

Compression ReadCompression(YamlMap& map, const char* key, Compression unset) {
  std::vector<std::string_view> names;
  size_t fallback = 0;
  for (const Choice& choice : kChoices) {
    if (choice.compression == unset) fallback = names.size();
    names.emplace_back(choice.name);
  }
  return kChoices[map.Choice(key, names, fallback)].compression;
}

std::string DefaultFolder() {
  const auto absolute = [](const char* name) {
    const char* const value = std::getenv(name);
    return value != nullptr && value[0] == '/' ? std::string(value) : std::string();
  };
  if (const std::string state = absolute("XDG_STATE_HOME"); !state.empty()) return state + "/taclink/logs";
  const std::string home = absolute("HOME");
  return home.empty() ? home : home + "/.local/state/taclink/logs";
}

const char* Name(Compression compression) {
  for (const Choice& choice : kChoices) {
    if (choice.compression == compression) return choice.name;
  }
  return "none";
}

}  // namespace

RecordingConfig ReadRecording(YamlMap& root, const std::function<std::string(const std::string&)>& path) {
  RecordingConfig config;
  YamlMap map = root.Map("recording");
  const std::string folder = map.Text("folder", DefaultFolder());
  if (!folder.empty()) config.folder = path(folder);
  config.at_start = map.Bool("at_start", config.at_start);
  if (config.at_start && folder.empty()) map.Fail("at_start", "needs a folder");
  config.pictures = map.Bool("pictures", config.pictures);
  config.compression = ReadCompression(map, "compression", config.compression);
  config.picture_compression = ReadCompression(map, "picture_compression", config.picture_compression);
  config.split_mb = map.Number("split_mb", config.split_mb, {.min = 0, .max = 1e6});
  config.split_s = map.Number("split_s", config.split_s, {.min = 0, .max = 1e6});
  config.quota_mb = map.Number("quota_mb", config.quota_mb, {.min = 0, .max = 1e9});
  config.sync_s = map.Number("sync_s", config.sync_s, {.min = 0.05, .max = 60});
  config.queue_mb = map.Number("queue_mb", config.queue_mb, {.min = 1, .max = 65536});
  config.scene_rate_hz = map.Number("scene_rate_hz", config.scene_rate_hz, {.min = 0, .max = 1000});
  map.Done();
  return config;
}

void WriteRecording(std::ostream& out, const RecordingConfig& config) {
  out << "recording:\n";
  out << "  folder: " << Quoted(config.folder) << "\n"
      << "  at_start: " << (config.at_start ? "true" : "false") << "\n"
      << "  pictures: " << (config.pictures ? "true" : "false") << "\n"
      << "  compression: " << Name(config.compression) << "\n"
      << "  picture_compression: " << Name(config.picture_compression) << "\n"
      << "  split_mb: " << config.split_mb << "\n"
      << "  split_s: " << config.split_s << "\n"
      << "  quota_mb: " << config.quota_mb << "\n"
      << "  sync_s: " << config.sync_s << "\n"
      << "  queue_mb: " << config.queue_mb << "\n"
      << "  scene_rate_hz: " << config.scene_rate_hz << "\n";
}

}  // namespace taclink::server

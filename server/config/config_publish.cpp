#include "server/config/config_publish.h"

#include <algorithm>
#include <array>

#include "sensing/core/name.h"
#include "server/config/config_names.h"

namespace taclink::server {
namespace {

constexpr std::array<std::string_view, 3> kDetails = {"contacts", "geometry", "full"};

void CheckUrl(YamlMap& map, const char* key, const std::string& urls) {
  for (const std::string& url : SplitUrls(urls)) {
    if (!url.starts_with("nats://") && !url.starts_with("tls://"))
      map.Fail(key, "must be nats://HOST:PORT or tls://HOST:PORT, several with commas between");
    if (url.find('@') != std::string::npos)
      map.Fail(key, "must not hold a password; use token_file or credentials");
  }
}

}  // namespace

std::vector<std::string> SplitUrls(const std::string& urls) {
  std::vector<std::string> out;
  for (size_t begin = 0; begin <= urls.size();) {
    const size_t end = std::min(urls.find(',', begin), urls.size());
    out.push_back(urls.substr(begin, end - begin));
    begin = end + 1;
  }
  return out;
}

PublishConfig ReadPublish(YamlMap& root, const std::function<std::string(const std::string&)>& path) {
  PublishConfig config;
  if (!root.Has("publish")) return config;
  if (root.HasScalar("publish")) {
    config.url = root.Text("publish");
    config.stream = "TACLINK_" + config.site;
    CheckUrl(root, "publish", config.url);
    return config;
  }
  YamlMap map = root.Map("publish");
  const auto file = [&](const char* key) {
    const std::string name = map.Text(key, "");
    return name.empty() ? name : path(name);
  };
  config.url = map.Text("url");
  if (!config.url.empty()) CheckUrl(map, "url", config.url);
  config.site = map.Text("site", config.site);
  if (const auto good = CheckSubjectPart(config.site); !good) map.Fail("site", good.error().message);
  config.stream = map.Text("stream", "TACLINK_" + config.site);
  if (const auto good = CheckSubjectPart(config.stream); !good) map.Fail("stream", good.error().message);
  config.stream_mb = map.Number("stream_mb", config.stream_mb, {.min = 1, .max = 1e9});
  config.tls_ca = file("tls_ca");
  config.certificate = file("certificate");
  config.key = file("key");
  if (config.certificate.empty() != config.key.empty()) map.Fail("key", "and certificate need each other");
  config.credentials = file("credentials");
  config.token_file = file("token_file");
  config.frames_detail = static_cast<Detail>(
      map.Choice("frames_detail", {kDetails.begin(), kDetails.end()}, Index(config.frames_detail)));
  config.frames_rate_hz = map.Number("frames_rate_hz", config.frames_rate_hz, {.min = 0, .max = 1000});
  config.contacts_deadband_n =
      map.Number("contacts_deadband_n", config.contacts_deadband_n, {.min = 0, .max = 1000});
  config.queue_mb = map.Number("queue_mb", config.queue_mb, {.min = 1, .max = 65536});
  map.Done();
  return config;
}

void WritePublish(std::ostream& out, const PublishConfig& config) {
  if (config.url.empty()) return;
  out << "publish:\n"
      << "  url: " << Quoted(config.url) << "\n"
      << "  site: " << Quoted(config.site) << "\n"
      << "  stream: " << Quoted(config.stream) << "\n"
      << "  stream_mb: " << config.stream_mb << "\n";
  const std::array<std::pair<const char*, const std::string*>, 5> files = {
      {{"tls_ca", &config.tls_ca},
       {"certificate", &config.certificate},
       {"key", &config.key},
       {"credentials", &config.credentials},
       {"token_file", &config.token_file}}};
  for (const auto& [key, value] : files) {
    if (!value->empty()) out << "  " << key << ": " << Quoted(*value) << "\n";
  }
  out << "  frames_detail: " << kDetails[Index(config.frames_detail)] << "\n"
      << "  frames_rate_hz: " << config.frames_rate_hz << "\n"
      << "  contacts_deadband_n: " << config.contacts_deadband_n << "\n"
      << "  queue_mb: " << config.queue_mb << "\n";
}

}  // namespace taclink::server

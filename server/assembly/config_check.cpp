#include "server/assembly/config_check.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>

#include "server/assembly/arm_builder.h"
#include "server/security/exposure.h"
#include "server/security/security.h"

namespace taclink::server {
namespace {

// "/dev/video0": the number changes from one start of the machine, or one plugging in, to the next.
bool IsNumberedNode(const std::string& device) {
  constexpr std::string_view kNode = "/dev/video";
  return device.starts_with(kNode) && device.size() > kNode.size() &&
         std::all_of(device.begin() + kNode.size(), device.end(),
                     [](unsigned char c) { return std::isdigit(c) != 0; });
}

void CheckCameras(const LinkConfig& link, std::map<std::string, std::string>& users, ConfigFindings& out) {
  const auto* v4l2 = std::get_if<V4l2SourceConfig>(&link.source);
  if (v4l2 == nullptr) return;
  for (const std::string& device : v4l2->devices) {
    const auto [user, fresh] = users.emplace(device, link.name);
    if (!fresh)
      out.errors.push_back("link '" + link.name + "': camera " + device + " is used by link '" +
                           user->second + "' already");
    if (IsNumberedNode(device))
      out.notes.push_back(
          "link '" + link.name + "': " + device +
          " may be another camera tomorrow; take its name in /dev/v4l/by-path or /dev/v4l/by-id");
    std::error_code ignored;
    if (device.starts_with('/') && !std::filesystem::exists(device, ignored))
      out.notes.push_back("link '" + link.name + "': " + device + " is not there now");
  }
}

}  // namespace

ConfigFindings CheckConfig(const Config& config, bool insecure_open) {
  ConfigFindings out;
  if (const auto security = Security::Load(config.security); !security)
    out.errors.push_back(security.error().message);
  if (const auto exposure = CheckExposure(config, insecure_open); exposure) {
    out.notes = *exposure;
  } else {
    out.errors.push_back(exposure.error().message);
  }
  for (const auto& link : BuildLinks(config, SystemClock()))
    if (!link) out.errors.push_back(link.error().message);
  std::map<std::string, std::string> users;  // camera: link
  for (const LinkConfig& link : config.links) CheckCameras(link, users, out);
  return out;
}

}  // namespace taclink::server

#include "server/assembly/config_check.h"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>

#include "sensing/capture/file_source.h"
#include "server/assembly/arm_builder.h"
#include "server/assembly/listen_check.h"
#include "server/security/exposure.h"
#include "server/security/security.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;

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
    if (device.starts_with('/') && !fs::exists(device, ignored))
      out.notes.push_back("link '" + link.name + "': " + device + " is not there now");
  }
}

// Two controllers of one regulator would contradict each other: the second one could not even open its line.
void CheckRegulator(const LinkConfig& link, std::map<std::string, std::string>& users, ConfigFindings& out) {
  const auto* regulator =
      link.pressure ? std::get_if<RegulatorPressureConfig>(&link.pressure->source) : nullptr;
  if (regulator == nullptr || !regulator->device) return;
  const auto [user, fresh] = users.emplace(*regulator->device, link.name);
  if (!fresh)
    out.errors.push_back("link '" + link.name + "': the pressure regulator " + *regulator->device +
                         " is used by link '" + user->second + "' already");
  std::error_code ignored;
  if (!fs::exists(*regulator->device, ignored))
    out.notes.push_back("link '" + link.name + "': " + *regulator->device + " is not there now");
}

// A server with such a link would start, and wait for pictures for ever.
void CheckPictures(const LinkConfig& link, ConfigFindings& out) {
  const auto* files = std::get_if<FileSourceConfig>(&link.source);
  if (files == nullptr) return;
  if (const auto pairs = CountPicturePairs(files->folder); !pairs)
    out.errors.push_back("link '" + link.name + "': " + pairs.error().message);
}

enum class Output { kFolder, kFile };

// Nothing is made here: what is there of the way to it must be a folder that lets one in.
Result<void> CheckCanBeMade(const std::string& path, Output output) {
  std::error_code error;
  const fs::path whole = fs::absolute(path);
  fs::path there = whole;
  while (there.has_relative_path() && !fs::exists(there, error)) there = there.parent_path();
  const bool file = output == Output::kFile && there == whole;
  const bool right = file ? fs::is_regular_file(there, error) : fs::is_directory(there, error);
  if (!right)
    return Error{ErrorCode::kFailedPrecondition,
                 path + ": " + there.string() + (file ? " is no regular file" : " is no folder")};
  if (access(there.c_str(), file ? W_OK : W_OK | X_OK) == 0) return {};
  return Error{ErrorCode::kPermissionDenied, path + ": " + there.string() + " can't be written to: " +
                                                 std::generic_category().message(errno)};
}

// Without its log the server does not start. It goes on without recordings and the audit, and says so: a disk
// that is late must not keep a service from starting.
void CheckOutputs(const Config& config, ConfigFindings& out) {
  const auto check = [](const char* key, const std::string& path, Output output,
                        std::vector<std::string>& to) {
    if (path.empty()) return;
    if (const auto good = CheckCanBeMade(path, output); !good)
      to.push_back(std::string(key) + ": " + good.error().message);
  };
  check("log.file", config.log.file, Output::kFile, out.errors);
  check("recording.folder", config.recording.folder, Output::kFolder, out.notes);
  check("events.audit", config.events.audit, Output::kFile, out.notes);
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
  if (const auto poses = BuildPoses(config); !poses) out.errors.push_back(poses.error().message);
  CheckListening(config, out);
  CheckOutputs(config, out);
  std::map<std::string, std::string> users;  // camera: link
  for (const LinkConfig& link : config.links) {
    CheckCameras(link, users, out);
    CheckRegulator(link, users, out);
    CheckPictures(link, out);
  }
  return out;
}

}  // namespace taclink::server

#include "sensing/capture/camera_finder.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

namespace taclink {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kUsb = "usb:", kSerial = "serial:", kNode = "video";

/// First line of a small file of sysfs; empty: there is none.
std::string ReadLine(const fs::path& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  while (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

int NodeNumber(const std::string& node) {
  const size_t at = node.rfind(kNode);
  int number = -1;
  if (at != std::string::npos)
    std::from_chars(node.data() + at + kNode.size(), node.data() + node.size(), number);
  return number;
}

/// The entry of one node; none: it gives no pictures.
std::optional<FoundCamera> ReadCamera(const fs::path& entry, const CameraPlaces& places) {
  // A driver's first node is its pictures', later ones are for metadata.
  if (const std::string index = ReadLine(entry / "index"); !index.empty() && index != "0")
    return std::nullopt;
  FoundCamera camera;
  camera.node = places.dev + "/" + entry.filename().string();
  camera.name = ReadLine(entry / "name");
  std::error_code failed;
  const fs::path device = fs::canonical(entry / "device", failed);
  // An interface of a USB device is named like its device, with a colon and its number.
  if (failed || device.filename().string().find(':') == std::string::npos) return camera;
  const fs::path usb = device.parent_path();
  if (!fs::exists(usb / "busnum", failed)) return camera;
  camera.usb_interface = device.filename().string();
  camera.usb_path = usb.filename().string();
  camera.serial = ReadLine(usb / "serial");
  return camera;
}

bool Matches(const FoundCamera& camera, std::string_view name) {
  if (name.starts_with(kUsb)) {
    name.remove_prefix(kUsb.size());
    return !camera.usb_path.empty() && (name == camera.usb_path || name == camera.usb_interface);
  }
  name.remove_prefix(kSerial.size());
  return !camera.serial.empty() && name == camera.serial;
}

std::string DescribeAll(const std::vector<FoundCamera>& cameras) {
  std::string list;
  for (const FoundCamera& camera : cameras) list += (list.empty() ? "" : ", ") + Describe(camera);
  return list;
}

}  // namespace

std::vector<FoundCamera> ListCameras(const CameraPlaces& places) {
  std::vector<FoundCamera> cameras;
  std::error_code failed;
  fs::directory_iterator entry(places.sys + "/class/video4linux", failed);
  for (; !failed && entry != fs::directory_iterator(); entry.increment(failed)) {
    if (!entry->path().filename().string().starts_with(kNode)) continue;
    if (auto camera = ReadCamera(entry->path(), places)) cameras.push_back(std::move(*camera));
  }
  std::ranges::sort(cameras, {}, [](const FoundCamera& camera) { return NodeNumber(camera.node); });
  return cameras;
}

Result<void> CheckCameraName(const std::string& name) {
  const bool known = name.starts_with("/") || (name.starts_with(kUsb) && name.size() > kUsb.size()) ||
                     (name.starts_with(kSerial) && name.size() > kSerial.size());
  if (known) return {};
  return Error{ErrorCode::kInvalidArgument,
               (name.empty() ? std::string("an empty text") : "'" + name + "'") +
                   " names no camera; expected a device path (best of /dev/v4l/by-path), usb:1-2.3 or "
                   "serial:NUMBER; 'taclink cameras' lists them"};
}

Result<std::string> FindCamera(const std::string& name, const CameraPlaces& places) {
  if (auto good = CheckCameraName(name); !good) return good.error();
  if (name.starts_with("/")) return name;
  const std::vector<FoundCamera> all = ListCameras(places);
  std::vector<FoundCamera> matching;
  for (const FoundCamera& camera : all)
    if (Matches(camera, name)) matching.push_back(camera);
  if (matching.size() == 1) return matching.front().node;
  if (matching.empty()) {
    return Error{ErrorCode::kUnavailable, name + ": no such camera; is it plugged in? There " +
                                              (all.empty() ? "is none" : "are " + DescribeAll(all))};
  }
  return Error{ErrorCode::kInvalidArgument,
               name + ": fits " + std::to_string(matching.size()) + " cameras: " + DescribeAll(matching) +
                   "; name one by its usb: path" +
                   (name.starts_with(kUsb) ? " with the interface, usb:" + matching.front().usb_interface
                                           : std::string())};
}

std::string Describe(const FoundCamera& camera) {
  std::string text = camera.node + " '" + camera.name + "'";
  if (!camera.usb_path.empty()) text += " usb:" + camera.usb_path;
  if (!camera.serial.empty()) text += " serial:" + camera.serial;
  return text;
}

}  // namespace taclink

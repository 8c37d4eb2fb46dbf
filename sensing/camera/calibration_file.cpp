#include "sensing/camera/calibration_file.h"

#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>

#include "sensing/core/fingerprint.h"
#include "sensing/core/read_file.h"
#include "sensing/core/utc_time.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr int kFormatVersion = 3;
constexpr int kWithIdentity = 3;  // first version with an identity
constexpr std::string_view kSerial = "serial:";

// Written for people; read only to be checked.
void ReadQuality(YamlMap map) {
  map.Integer("pairs", {.min = 1});
  for (const char* key : {"rms_px", "rmse_r_mm", "rmse_phi_r_mm", "rmse_z_mm", "rmse_3d_mm"})
    map.Number(key, kNotNegative);
  map.Done();
}

void ReadSigmas(YamlMap map) {
  for (const CameraId id : kBothCameras) {
    YamlMap one = map.Map(Name(id));
    one.Numbers("position_mm", 3, kNotNegative);
    one.Numbers("rotation_deg", 3, kNotNegative);
    one.Numbers("principal_point_px", 2, kNotNegative);
    one.Number("focal_px", kNotNegative);
    one.Numbers("k", 0, kNotNegative);
    one.Done();
  }
  map.Done();
}

template <typename Vector>
std::string List(const Vector& values) {
  std::ostringstream out;
  for (Eigen::Index i = 0; i < values.size(); ++i) out << (i > 0 ? ", " : "[") << values[i];
  return out.str() + "]";
}

std::string SigmasText(const CameraCalibration& one, const std::string& indent) {
  const CameraStep& s = one.sigmas;
  const int ks = LensParameterCount(one.camera.lens.kind) - 1;
  std::ostringstream out;
  out << indent << "position_mm: " << List(s.segment<3>(3)) << "\n"
      << indent << "rotation_deg: " << List(s.head<3>() * DegFromRad(1)) << "\n"
      << indent << "principal_point_px: " << List(s.segment<2>(6)) << "\n"
      << indent << "focal_px: " << s[8] << "\n"
      << indent << "k: " << List(s.segment(9, ks)) << "\n";
  return out.str();
}

// Fingerprint of marker positions and image sizes: a calibration of another skin or resolution differs in it.
// The material may change.
std::string SkinFingerprint(const LinkModel& model) {
  std::string text;
  for (int m = 0; m < model.markers.count(); ++m) {
    const Vec3 p = model.RestMarker(m);
    // Rounded to 1 um with an offset from the decimals of model files, so that all machines agree.
    for (const double mm : {p.x(), p.y(), p.z()}) text += std::to_string(std::lround(1e3 * mm + 0.137)) + " ";
  }
  for (const CameraId id : kBothCameras) {
    const CameraModel& camera = model.nominal_rig[id];
    text += std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) + "\n";
  }
  return Fingerprint(text);
}

// Fingerprint of the file without the `link` and `hash` lines.
std::string FileHash(std::string_view content) {
  std::string covered;
  while (!content.empty()) {
    const size_t end = std::min(content.find('\n'), content.size() - 1) + 1;
    std::string_view line = content.substr(0, end);
    content.remove_prefix(end);
    while (!line.empty() && (line.back() == '\n' || line.back() == '\r')) line.remove_suffix(1);
    if (line.starts_with("link:") || line.starts_with("hash:")) continue;
    covered += line;
    covered += '\n';
  }
  return Fingerprint(covered);
}

std::string Quoted(const std::string& text) {
  return "'" + text + "'";
}

// A name as a YAML scalar.
std::string Scalar(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

void CheckDevices(YamlMap& root, const std::array<std::string, kCameraCount>& made_with,
                  const std::array<std::string, kCameraCount>& used) {
  if (used[0].empty() || used[1].empty()) return;
  if (made_with[0] == used[1] && made_with[1] == used[0] && used[0] != used[1]) {
    return root.Fail("devices", "names the cameras the other way round than the link's configuration: " +
                                    Quoted(made_with[0]) +
                                    " is the top one here; exchange 'devices' there, or "
                                    "calibrate again");
  }
  for (const CameraId id : kBothCameras) {
    const std::string &made = made_with[Index(id)], &use = used[Index(id)];
    if (made == use || !made.starts_with(kSerial) || !use.starts_with(kSerial)) continue;
    return root.Fail("devices", std::string("says that the ") + Name(id) + " camera was " + Quoted(made) +
                                    ", but the link's is " + Quoted(use) + "; calibrate again");
  }
}

CalibrationIdentity ReadIdentity(YamlMap& root, const LinkModel& model, const CalibrationIdentity& of) {
  CalibrationIdentity identity;
  identity.link = root.Text("link", "");
  if (!identity.link.empty() && !of.link.empty() && identity.link != of.link) {
    root.Fail("link", "is " + Quoted(identity.link) + ", but this is the calibration file of link " +
                          Quoted(of.link) +
                          "; if that is the same link under a new name, correct this line, else "
                          "calibrate link " +
                          Quoted(of.link));
  }
  const std::string made = root.Text("made", "");
  const auto made_s = ParseUtc(made);
  if (!made.empty() && !made_s) root.Fail("made", "must be a time such as 2027-01-31T00:00:00Z");
  identity.made_utc_s = made_s.value_or(0);
  if (root.Has("devices")) {
    YamlMap devices = root.Map("devices");
    for (const CameraId id : kBothCameras) identity.devices[Index(id)] = devices.Text(Name(id));
    devices.Done();
    CheckDevices(root, identity.devices, of.devices);
  }
  const std::string skin = root.Text("skin");
  if (!root.Failed("skin") && skin != SkinFingerprint(model)) {
    root.Fail("skin", "is " + Quoted(skin) + ", but the markers of model " + Quoted(model.name) +
                          " lie elsewhere, or its images have another size: " +
                          Quoted(SkinFingerprint(model)) + "; calibrate again");
  }
  return identity;
}

Result<SavedCalibration> ReadCalibration(Result<YamlFile> file, std::string_view content,
                                         const LinkModel& model, const CalibrationIdentity& of) {
  if (!file) return file.error();
  YamlMap& root = file->root();
  const int version = root.Integer("taclink_calibration", {.min = 1, .max = kFormatVersion});
  // Another version's keys mean something else.
  if (root.Has("taclink_calibration") && root.Failed("taclink_calibration")) return file->Finish().error();
  if (const std::string name = root.Text("model"); !name.empty() && name != model.name) {
    root.Fail("model", "is '" + name + "', but the link's model is '" + model.name + "'");
  }
  root.Integer("markers_used", 0);
  SavedCalibration saved;
  if (version == 1) {
    root.Number("rms_px", 0.0);
  } else {
    if (root.Has("quality")) ReadQuality(root.Map("quality"));
    if (root.Has("standard_deviations")) ReadSigmas(root.Map("standard_deviations"));
  }
  saved.hash = FileHash(content);
  if (version >= kWithIdentity) {
    saved.identity = ReadIdentity(root, model, of);
    const std::string hash = root.Text("hash");
    if (!root.Failed("hash") && hash != saved.hash) {
      root.Fail("hash",
                "is not that of this content (" + Quoted(saved.hash) +
                    "): the file was damaged, or changed "
                    "after the calibration; calibrate again, or write this hash if the change is meant");
    }
  }
  YamlMap cameras = root.Map("cameras");
  for (const CameraId id : kBothCameras) saved.rig[id] = ReadCamera(cameras.Map(Name(id)), id);
  cameras.Done();
  root.Done();
  if (auto good = file->Finish(); !good) return good.error();
  return saved;
}

std::string IdentityText(const LinkModel& model, const CalibrationIdentity& identity) {
  std::string text;
  if (!identity.link.empty()) text += "link: " + Scalar(identity.link) + "\n";
  if (identity.made_utc_s != 0) text += "made: " + UtcText(identity.made_utc_s) + "\n";
  if (!identity.devices[0].empty() && !identity.devices[1].empty()) {
    text += "devices:\n";
    for (const CameraId id : kBothCameras)
      text += std::string("  ") + Name(id) + ": " + Scalar(identity.devices[Index(id)]) + "\n";
  }
  return text + "skin: " + SkinFingerprint(model) + "  # of the markers' places and the images' sizes\n";
}

}  // namespace

Result<SavedCalibration> LoadCalibration(const std::string& path, const LinkModel& model,
                                         const CalibrationIdentity& of) {
  const auto content = ReadFile(path);
  if (!content) return content.error();
  return ParseCalibration(path, *content, model, of);
}

Result<SavedCalibration> ParseCalibration(const std::string& name, std::string_view content,
                                          const LinkModel& model, const CalibrationIdentity& of) {
  return ReadCalibration(YamlFile::Parse(name, content), content, model, of);
}

std::string CalibrationText(const LinkModel& model, const CalibrationSummary& summary,
                            const CalibrationIdentity& identity) {
  std::ostringstream out;
  out << "taclink_calibration: " << kFormatVersion << "\nmodel: " << model.name << "\n"
      << IdentityText(model, identity) << "markers_used: " << summary.markers_used
      << "\nquality:  # rest markers against the model"
      << "\n  pairs: " << summary.pairs << "\n  rms_px: " << summary.rms_px
      << "\n  rmse_r_mm: " << summary.rmse_r_mm << "\n  rmse_phi_r_mm: " << summary.rmse_phi_r_mm
      << "\n  rmse_z_mm: " << summary.rmse_z_mm << "\n  rmse_3d_mm: " << summary.rmse_3d_mm << "\ncameras:\n";
  for (const CameraId id : kBothCameras) {
    out << "  " << Name(id) << ":\n" << CameraText(summary.rig[id], id, "    ");
  }
  if (summary.covariance.size() > 0) {
    out << "standard_deviations:\n";
    for (const CameraId id : kBothCameras) {
      out << "  " << Name(id) << ":\n" << SigmasText(summary.cameras[Index(id)], "    ");
    }
  }
  return out.str() + "hash: " + FileHash(out.str()) + "  # of all lines but this one and `link`\n";
}

Result<void> SaveCalibration(const std::string& path, const std::string& text,
                             const std::function<bool()>& may_replace) {
  // Of this call alone: another one may hang while it writes its own.
  static std::atomic<unsigned> calls = 0;
  const std::string part = path + ".part" + std::to_string(++calls);
  std::ofstream out(part, std::ios::trunc);
  out << text;
  out.close();
  const bool wanted = !may_replace || may_replace();
  std::error_code error, ignored;
  if (out && wanted) {
    std::filesystem::rename(part, path, error);
    if (!error) return {};
  }
  std::filesystem::remove(part, ignored);
  if (!wanted)
    return Error{ErrorCode::kUnavailable, "the calibration file '" + path +
                                              "' is not replaced: nobody waits for the calibration any more"};
  return Error{ErrorCode::kUnavailable, "cannot write the calibration file '" + path + "'"};
}

}  // namespace taclink

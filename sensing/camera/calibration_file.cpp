#include <atomic>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>

#include "sensing/camera/calibration.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr int kFormatVersion = 2;

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

Result<StereoRig> ReadRig(Result<YamlFile> file, const LinkModel& model) {
  if (!file) return file.error();
  YamlMap& root = file->root();
  const int version = root.Integer("taclink_calibration", {.min = 1, .max = kFormatVersion});
  // Another version's keys mean something else.
  if (root.Has("taclink_calibration") && root.Failed("taclink_calibration")) return file->Finish().error();
  if (const std::string name = root.Text("model"); !name.empty() && name != model.name) {
    root.Fail("model", "is '" + name + "', but the link's model is '" + model.name + "'");
  }
  root.Integer("markers_used", 0);
  if (version == 1) {
    root.Number("rms_px", 0.0);
  } else {
    if (root.Has("quality")) ReadQuality(root.Map("quality"));
    if (root.Has("standard_deviations")) ReadSigmas(root.Map("standard_deviations"));
  }
  StereoRig rig;
  YamlMap cameras = root.Map("cameras");
  for (const CameraId id : kBothCameras) rig[id] = ReadCamera(cameras.Map(Name(id)), id);
  cameras.Done();
  root.Done();
  if (auto good = file->Finish(); !good) return good.error();
  return rig;
}

}  // namespace

Result<StereoRig> LoadCalibration(const std::string& path, const LinkModel& model) {
  return ReadRig(YamlFile::Load(path), model);
}

Result<StereoRig> ParseCalibration(const std::string& name, std::string_view content,
                                   const LinkModel& model) {
  return ReadRig(YamlFile::Parse(name, content), model);
}

std::string CalibrationText(const std::string& model_name, const CalibrationSummary& summary) {
  std::ostringstream out;
  out << "taclink_calibration: " << kFormatVersion << "\nmodel: " << model_name
      << "\nmarkers_used: " << summary.markers_used << "\nquality:  # rest markers against the model"
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
  return out.str();
}

Result<void> SaveCalibration(const std::string& path, const std::string& model_name,
                             const CalibrationSummary& summary, const std::function<bool()>& may_replace) {
  // Of this call alone: another one may hang while it writes its own.
  static std::atomic<unsigned> calls = 0;
  const std::string part = path + ".part" + std::to_string(++calls);
  std::ofstream out(part, std::ios::trunc);
  out << CalibrationText(model_name, summary);
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

#include "sensing/camera/calibration_parameters.h"

#include <cmath>

#include "sensing/camera/lens.h"
#include "sensing/camera/projection.h"

namespace taclink {
namespace {

std::vector<CalibrationParameter> ParametersOfOne(CameraId id, const CameraModel& camera,
                                                  const CameraModel& nominal, const CameraStep& sigmas) {
  const Vec3 place = camera.camera_from_link.Inverse().translation;
  CameraModel designed = nominal;
  designed.lens.kind = camera.lens.kind;
  const Vec3 turn = StepBetween(designed, camera).head<3>();
  std::vector<CalibrationParameter> out;
  const auto add = [&](const char* name, const char* unit, double value, double sigma) {
    out.push_back({.camera = id, .name = name, .unit = unit, .value = value, .sigma = sigma});
  };
  add("position_x", "mm", place.x(), sigmas[3]);
  add("position_y", "mm", place.y(), sigmas[4]);
  add("position_z", "mm", place.z(), sigmas[5]);
  add("tilt_x", "rad", turn.x(), sigmas[0]);
  add("tilt_y", "rad", turn.y(), sigmas[1]);
  add("roll", "rad", turn.z(), sigmas[2]);
  add("principal_point_x", "px", camera.lens.principal_point_px.x(), sigmas[6]);
  add("principal_point_y", "px", camera.lens.principal_point_px.y(), sigmas[7]);
  add("focal_length", "px", camera.lens.focal_px, sigmas[8]);
  const LensParameters lens = ParametersOf(camera.lens);
  for (int i = 1; i < LensParameterCount(camera.lens.kind); ++i) {
    const bool is_division = camera.lens.kind == LensKind::kDivision;
    const char* unit = !is_division ? "1" : i == 1 ? "px^-2" : "px^-4";
    add(("lens_k" + std::to_string(i)).c_str(), unit, lens[i], sigmas[8 + i]);
  }
  return out;
}

std::vector<CalibrationParameter> ParametersOfBoth(const CalibrationSummary& summary,
                                                   const StereoRig& nominal) {
  std::vector<CalibrationParameter> out;
  for (const CameraId id : kBothCameras) {
    for (auto& one : ParametersOfOne(id, summary.rig[id], nominal[id], summary.cameras[Index(id)].sigmas))
      out.push_back(std::move(one));
  }
  return out;
}

}  // namespace

std::vector<CalibrationParameter> ParametersOf(std::span<const CalibrationSummary> calibrations,
                                               const StereoRig& nominal) {
  if (calibrations.empty()) return {};
  std::vector<CalibrationParameter> out = ParametersOfBoth(calibrations.back(), nominal);
  const auto count = static_cast<double>(calibrations.size());
  if (count < 2) return out;
  std::vector<double> sums(out.size()), squares(out.size());
  std::vector<std::vector<CalibrationParameter>> all;
  for (const CalibrationSummary& one : calibrations) all.push_back(ParametersOfBoth(one, nominal));
  for (size_t i = 0; i < out.size(); ++i) {
    for (const auto& one : all) sums[i] += one[i].value;
    const double mean = sums[i] / count;
    for (const auto& one : all) squares[i] += (one[i].value - mean) * (one[i].value - mean);
    out[i].mean = mean;
    out[i].scatter = std::sqrt(squares[i] / (count - 1));
  }
  return out;
}

}  // namespace taclink

#include "client/command/live/calibrate_link.h"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <fstream>

#include "client/command/cli/json.h"
#include "client/command/cli/units.h"
#include "client/command/live/connect.h"
#include "client/command/live/parameter_table.h"
#include "sensing/core/geometry.h"
#include "sensing/core/utc_time.h"

namespace taclink::command {
namespace {

void PrintShift(const v1::CalibrationResult& result, const v1::CameraShift& shift) {
  const int64_t previous_s = result.previous_utc_ns() / 1'000'000'000;
  fmt::print(
      "The {} camera has moved by {:.2f} mm and turned by {:.2f} degrees since the calibration before{}{}\n",
      shift.camera(), shift.moved_m() * kMmPerMetre, DegFromRad(shift.turned_rad()),
      previous_s == 0 ? "" : " (" + UtcText(previous_s) + ")",
      shift.is_large() ? ": it was mounted again, or knocked" : "");
}

void PrintText(const v1::CalibrationResult& result) {
  fmt::print(
      "{} markers seen by both cameras, RMS {:.3f} px per axis\n"
      "Rest markers, triangulated, against the model: RMSE R {:.3f} mm, phi*R {:.3f} mm, Z {:.3f} mm\n",
      result.markers_used(), result.rms_px(), result.rmse_r_m() * kMmPerMetre,
      result.rmse_tangential_m() * kMmPerMetre, result.rmse_z_m() * kMmPerMetre);
  if (!result.parameters().empty()) {
    fmt::print("\n");
    PrintParameters(ToParameters(result), result.repeats());
    fmt::print("\n");
  }
  if (!result.ended_early().empty())
    fmt::print("ended after {} calibrations: {}\n", result.repeats(), result.ended_early());
  for (const v1::CameraShift& shift : result.shifts()) PrintShift(result, shift);
  if (!result.saved_to().empty()) fmt::print("saved on the server: {}\n", result.saved_to());
}

Json ShiftsJson(const v1::CalibrationResult& result) {
  Json out = Json::array();
  for (const v1::CameraShift& shift : result.shifts()) {
    out.push_back({{"camera", shift.camera()},
                   {"moved_mm", shift.moved_m() * kMmPerMetre},
                   {"turned_deg", DegFromRad(shift.turned_rad())},
                   {"is_large", shift.is_large()}});
  }
  return out;
}

void PrintCalibrationJson(const std::string& link, const v1::CalibrationResult& result) {
  const Json json = {{"link", link},
                     {"markers_used", result.markers_used()},
                     {"rms_px", result.rms_px()},
                     {"rmse_mm",
                      {{"r", result.rmse_r_m() * kMmPerMetre},
                       {"phi_r", result.rmse_tangential_m() * kMmPerMetre},
                       {"z", result.rmse_z_m() * kMmPerMetre}}},
                     {"repeats", result.repeats()},
                     {"ended_early", result.ended_early()},
                     {"previous_utc_ns", result.previous_utc_ns()},
                     {"cameras_moved", ShiftsJson(result)},
                     {"parameters", ParametersJson(ToParameters(result))},
                     {"saved_to", result.saved_to()}};
  fmt::print("{}\n", json.dump());
}

}  // namespace

Result<void> CalibrateLink(const LinkCalibration& calibration) {
  auto connection = ConnectTo(calibration.server);
  if (!connection) return connection.error();
  bool told = false;
  v1::CalibrateRequest request;
  request.set_link(calibration.link);
  request.set_pairs(static_cast<uint32_t>(calibration.pairs));
  request.set_repeats(static_cast<uint32_t>(calibration.repeats));
  request.set_save(calibration.save);
  request.set_force(calibration.force);
  const auto result = connection->Calibrate(
      request,
      [&told](const v1::CalibrationProgress& progress) {
        told = true;
        fmt::print(stderr, "\r{} of {} rest pairs", progress.pairs_taken(), progress.pairs_wanted());
        return true;
      },
      client::Patience(std::chrono::seconds(60)) * calibration.repeats);
  if (told) fmt::print(stderr, "\n");
  if (!result) return result.error();
  if (!calibration.out.empty()) {
    std::ofstream file(calibration.out, std::ios::trunc);
    file << result->file_text();
    file.close();
    if (!file)
      return Error{ErrorCode::kUnavailable,
                   "cannot write '" + calibration.out + "'; the link uses the result"};
  }
  if (calibration.json) {
    PrintCalibrationJson(calibration.link, *result);
  } else {
    PrintText(*result);
  }
  return {};
}

}  // namespace taclink::command

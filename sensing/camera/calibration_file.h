#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "sensing/camera/calibration.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink {

/// The link that a calibration belongs to. Empty or 0: unknown, not compared.
struct CalibrationIdentity {
  std::string link = {};                               ///< name in the server's configuration
  std::array<std::string, kCameraCount> devices = {};  ///< the cameras as configured: path, usb: or serial:
  int64_t made_utc_s = 0;                              ///< since 1970-01-01
};

/// The content of a calibration file.
struct SavedCalibration {
  StereoRig rig;
  CalibrationIdentity identity;
  std::string hash = {};  ///< fingerprint of the file without the lines `link` and `hash`
};

/// Calibration files (YAML, `taclink_calibration: 3`; versions 1 and 2, without an identity, are also read).
/// A file is rejected if it names another model, a skin with other markers, another link than `of`, the
/// cameras of `of` in exchanged places, or other serial numbers, or if it was edited after the calibration.
/// Errors: kNotFound, kInvalidArgument (file, line, what was expected, what to do).
Result<SavedCalibration> LoadCalibration(const std::string& path, const LinkModel& model,
                                         const CalibrationIdentity& of = {});
/// Parses a file's text; `name` stands for the file in messages. Errors: kInvalidArgument.
Result<SavedCalibration> ParseCalibration(const std::string& name, std::string_view content,
                                          const LinkModel& model, const CalibrationIdentity& of = {});
/// The file's text.
std::string CalibrationText(const LinkModel& model, const CalibrationSummary& summary,
                            const CalibrationIdentity& identity = {});
/// Replaces the whole file by `text`. `may_replace` is called after the new content is written and before it
/// is renamed; empty: allowed. Errors: kUnavailable, also if not allowed; the file is then unchanged.
Result<void> SaveCalibration(const std::string& path, const std::string& text,
                             const std::function<bool()>& may_replace = {});

}  // namespace taclink

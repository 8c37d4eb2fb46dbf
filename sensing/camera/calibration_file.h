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

/// Which link a calibration belongs to. Empty or 0: not known, and not compared.
struct CalibrationIdentity {
  std::string link = {};  ///< name in the server's configuration
  std::array<std::string, kCameraCount> devices =
      {};                  ///< of the cameras, as configured: path, usb: or serial:
  int64_t made_utc_s = 0;  ///< since 1970-01-01
};

/// The content of a calibration file.
struct SavedCalibration {
  StereoRig rig;
  CalibrationIdentity identity;
  std::string hash = {};  ///< Fingerprint of the file, without the lines `link` and `hash`
};

/// Calibration files (YAML, `taclink_calibration: 3`; 1 and 2, which have no identity, are read too). A file
/// is refused if it names another model, a skin with other markers, another link than `of`, cameras that `of`
/// has in exchanged places, cameras with other serial numbers, or if it was changed since it was written.
/// Errors: kNotFound, kInvalidArgument (file, line, what was expected, what to do).
Result<SavedCalibration> LoadCalibration(const std::string& path, const LinkModel& model,
                                         const CalibrationIdentity& of = {});
/// The same from a file's text; `name` stands for the file in messages. Errors: kInvalidArgument.
Result<SavedCalibration> ParseCalibration(const std::string& name, std::string_view content,
                                          const LinkModel& model, const CalibrationIdentity& of = {});
/// The file's text.
std::string CalibrationText(const LinkModel& model, const CalibrationSummary& summary,
                            const CalibrationIdentity& identity = {});
/// Replaces the file as a whole by `text`. `may_replace` is asked when the new content is written and only
/// its name is missing; empty: it may. Errors: kUnavailable, also where it may not; then the file is as it
/// was.
Result<void> SaveCalibration(const std::string& path, const std::string& text,
                             const std::function<bool()>& may_replace = {});

}  // namespace taclink

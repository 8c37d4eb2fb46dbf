#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/baseline.h"
#include "sensing/core/calibration_report.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/frame.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {
class StateEstimator;  // handed on only: whoever runs links needs no estimator's library
}

namespace taclink::server {

struct CalibrationOrder {
  int pairs = 8;       ///< rest pairs to average over
  int repeats = 1;     ///< calibrations, one after the other; the link uses the last
  bool save = false;   ///< write the configured calibration file
  bool force = false;  ///< even while touched
  /// Asked right before the file is replaced: a worker that was given up replaces nothing. Empty: it may.
  std::function<bool()> may_save = {};
};

/// A camera against where it was calibrated before.
struct CameraMove {
  CameraShift shift;
  bool is_large = false;  ///< more than calibrations differ by
};

/// How well the cameras fit the rest markers. RMS.
struct CalibrationResult {
  int markers_used = 0;  ///< seen by both cameras
  double rms_px = 0;     ///< of the reprojection, each axis
  double rmse_r_mm = 0, rmse_tangential_mm = 0, rmse_z_mm = 0;
  std::string file_text = {};  ///< of the calibration file
  std::string saved_to = {};   ///< empty: nowhere
  std::vector<CalibrationParameter> parameters = {};
  int repeats = 1;
  std::string ended_early = {};  ///< why there are fewer repeats than asked for; empty: there are not
  /// Against the calibration that was in use before, made at that time (since 1970-01-01; 0: not known).
  /// None: there was none.
  int64_t previous_utc_ns = 0;
  std::array<std::optional<CameraMove>, kCameraCount> moves = {};
};

struct CalibrationProgress {
  int taken = 0, wanted = 0;     ///< rest pairs
  std::string waiting_for = {};  ///< why the newest frame cannot be a rest pair; empty: it is one
  /// Set once: the end. An error leaves the link as it was.
  std::optional<Result<CalibrationResult>> end;
};

/// What a worker takes a link's frames through. One thread.
class LinkProcessor {
 public:
  virtual ~LinkProcessor() = default;

  /// The whole way; fills all of the state, whose buffers it reuses.
  virtual void Process(const StereoFrame& frame, LinkState& state) = 0;

  /// Takes the next frames as rest pairs. Errors: kFailedPrecondition (touched; no file to save to).
  virtual Result<void> BeginCalibration(const CalibrationOrder& order) = 0;
  /// After each Process since BeginCalibration, until it has told the end.
  virtual CalibrationProgress PollCalibration() = 0;
  /// Back to how it was.
  virtual void CancelCalibration() = 0;

  /// Makes the mean of the next frames the baseline. Errors: kFailedPrecondition (there is none yet, one is
  /// under way), kUnsupported.
  virtual Result<void> BeginTare(const TareOptions&) {
    return Error{ErrorCode::kUnsupported, "this link has no baseline"};
  }
  /// After each Process since BeginTare, until it has told the end. An error leaves the link as it was.
  virtual std::optional<Result<TareSummary>> TakeTareEnd() { return {}; }
  virtual void CancelTare() {}

  /// What was found in the pictures of the last frame that was measured; null: not known.
  virtual const LabelledMarkers* labels() const { return nullptr; }
  /// Computes the forces so from the next frame on. Not null. Errors: kUnsupported.
  virtual Result<void> UseEstimator(std::shared_ptr<StateEstimator>) {
    return Error{ErrorCode::kUnsupported, "this link computes no forces"};
  }
};

}  // namespace taclink::server

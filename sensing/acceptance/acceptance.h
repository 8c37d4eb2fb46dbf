#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_state.h"

namespace taclink {

/// Acceptance of a link: its measurements are compared with external references (known weights, a force
/// gauge, a probe moved by a robot, a manometer). The result is errors with confidence intervals, and their
/// limits. Link frame; mm, N, MPa, s.

/// What a person or a robot does in one trial.
enum class TrialKind : uint8_t {
  kLoad,      ///< apply a load, then remove it
  kHold,      ///< apply a load, hold it for hold_s, then remove it
  kPressure,  ///< set the pressure inside the skin; nothing touches the skin
};
inline constexpr const char* kTrialKindNames[] = {"load", "hold", "pressure"};
inline const char* Name(TrialKind kind) {
  return kTrialKindNames[static_cast<size_t>(kind)];
}

enum class TrialState : uint8_t { kOpen, kMeasured, kSkipped };

/// External reference of a load or a pressure.
struct TrialReference {
  std::optional<double> force_n = {};  ///< magnitude
  double force_sigma_n = 0;            ///< standard deviation of force_n
  std::optional<Vec3> place_mm = {};   ///< point of contact on the outer surface
  /// Unit vector of the force on the skin; none: the skin's inward normal at the place.
  std::optional<Vec3> direction = {};
  std::optional<double> pressure_mpa = {};  ///< gauge, from a manometer
};

/// One sample of the force of a held load.
struct HeldSample {
  double time_s = 0;   ///< since the start of the reading
  double force_n = 0;  ///< mean over about a second
};

/// A reason for reduced quality, and the number of frames that report it.
struct ReadingReason {
  ReasonId id = ReasonId::kFewMarkers;
  int frames = 0;
  std::string text = {};  ///< from the last of these frames
};

/// Measurement of one phase of a trial: means over its frames.
struct TrialReading {
  int64_t utc_ns = 0;        ///< exposure of the first frame
  double duration_s = 0;     ///< from the first to the last exposure
  int frames = 0;            ///< all frames
  int usable = 0;            ///< frames with forces; the means are over these
  bool has_contact = false;  ///< in at least half of the usable frames; otherwise force and center are zero
  double force_n = 0;        ///< of the load's contacts (Contact::magnitude_n)
  double force_sd_n = 0;     ///< standard deviation of force_n from frame to frame
  /// Standard deviation of the force as reported by the link; none: not reported.
  std::optional<double> stated_sigma_n = {};
  Vec3 center_mm = Vec3::Zero();
  Vec3 total_force_n = Vec3::Zero();        ///< sum over all contacts
  double others_n = 0;                      ///< sum of the magnitudes of all other contacts
  std::optional<double> pressure_mpa = {};  ///< from the link's sensor
  double baseline_drift_mm = 0;
  int64_t baseline_utc_ns = 0;  ///< time of the baseline
  std::vector<ReadingReason> reasons = {};
  std::vector<HeldSample> held = {};  ///< loaded phase of a kHold trial only
};

/// One trial: the plan and the measurement.
struct AcceptanceTrial {
  uint32_t id = 0;  ///< from 1, in the order of the trials
  TrialKind kind = TrialKind::kLoad;
  int path = 0, ring = 0;                   ///< marker under the load, from 1; 0: no place
  std::optional<double> force_n = {};       ///< planned load
  std::optional<double> pressure_mpa = {};  ///< planned gauge pressure; none: unchanged
  std::string attitude = {};                ///< name of the link's attitude; empty: unchanged
  double hold_s = 0;
  int repetition = 1;

  TrialState state = TrialState::kOpen;
  TrialReference reference = {};
  std::optional<TrialReading> unloaded = {}, loaded = {},
                              released = {};  ///< before, during and after the load
};

/// Largest accepted errors; 0: not limited.
struct AcceptanceLimits {
  /// Errors of weaker loads are relative to this force: 10 % of 0.3 N allows an error of 0.03 N.
  double force_floor_n = 0.3;
  double force_error = 0.10;      ///< 95th percentile of the relative error of single loads
  double force_bias = 0.06;       ///< magnitude of the mean relative error
  double place_error_mm = 4;      ///< 95th percentile
  double repeatability = 0.05;    ///< relative standard deviation of repeated loads
  double ghost_n = 0.03;          ///< force after a load was removed, 95th percentile
  double creep = 0.05;            ///< magnitude of the relative change of the force of a held load
  double pressure_slope = 0.08;   ///< magnitude of the change of the relative force error per kPa
  double attitude_effect = 0.06;  ///< largest difference of mean relative errors between attitudes
  double balance = 0.15;          ///< 95th percentile of |resultant of all contacts - load| / load
  double pressure_error = 0.03;   ///< relative error of the pressure sensor's gain
  double drift_mm_per_h = 0.5;    ///< drift of the baseline
};

/// All trials of one acceptance of one link.
struct AcceptanceRecord {
  std::string link = {}, plan = {};                 ///< names
  std::string model = {};                           ///< name of the link model
  std::string model_hash = {};                      ///< fingerprint of the model file; empty: unknown
  int64_t calibrated_utc_ns = 0;                    ///< calibration time of the cameras in use; 0: unknown
  int64_t started_utc_ns = 0, finished_utc_ns = 0;  ///< 0: not finished
  AcceptanceLimits limits = {};
  std::vector<AcceptanceTrial> trials = {};
};

/// The next open trial; null: none is open.
const AcceptanceTrial* NextTrial(const AcceptanceRecord& record);

}  // namespace taclink

#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_state.h"

namespace taclink {

/// Acceptance of a link: measurements against references from outside (known weights, a force gauge, a probe
/// that a robot moves, a manometer), their errors with confidence intervals, and limits for them. Link frame;
/// mm, N, MPa, s.

/// What a person or a robot does in one trial.
enum class TrialKind : uint8_t {
  kLoad,      ///< a load is put on and taken off again
  kHold,      ///< a load is put on, stays for hold_s and is taken off again
  kPressure,  ///< the pressure inside the skin is set; nothing touches the skin
};
inline constexpr const char* kTrialKindNames[] = {"load", "hold", "pressure"};
inline const char* Name(TrialKind kind) {
  return kTrialKindNames[static_cast<size_t>(kind)];
}

enum class TrialState : uint8_t { kOpen, kMeasured, kSkipped };

/// What is known from outside about a load or a pressure.
struct TrialReference {
  std::optional<double> force_n = {};  ///< magnitude
  double force_sigma_n = 0;            ///< standard deviation of the reference itself
  std::optional<Vec3> place_mm = {};   ///< where the load touches, on the outer surface
  /// Unit vector of the load's force on the skin; none: along the skin's inward normal at the place.
  std::optional<Vec3> direction = {};
  std::optional<double> pressure_mpa = {};  ///< gauge, by a manometer
};

/// The force of a held load over time.
struct HeldSample {
  double time_s = 0;   ///< since the reading began
  double force_n = 0;  ///< mean over about a second
};

/// Which reason made frames worse, and in how many.
struct ReadingReason {
  ReasonId id = ReasonId::kFewMarkers;
  int frames = 0;
  std::string text = {};  ///< of the last such frame
};

/// What the link measured during one phase of a trial: means over its frames.
struct TrialReading {
  int64_t utc_ns = 0;        ///< exposure of the first frame
  double duration_s = 0;     ///< from the first to the last exposure
  int frames = 0;            ///< all
  int usable = 0;            ///< with forces; the means are over these
  bool has_contact = false;  ///< in at least half of the usable frames; else force and center are zero
  double force_n = 0;        ///< of the load's contact (Contact::magnitude_n)
  double force_sd_n = 0;     ///< standard deviation of that from frame to frame
  /// Standard deviation that the link itself states for the force; none: it states none.
  std::optional<double> stated_sigma_n = {};
  Vec3 center_mm = Vec3::Zero();
  Vec3 total_force_n = Vec3::Zero();        ///< sum over all contacts
  double others_n = 0;                      ///< magnitudes of all other contacts
  std::optional<double> pressure_mpa = {};  ///< as the link's sensor has it
  double baseline_drift_mm = 0;
  int64_t baseline_utc_ns = 0;  ///< when the baseline was taken
  std::vector<ReadingReason> reasons = {};
  std::vector<HeldSample> held = {};  ///< of a kHold trial's loaded phase
};

/// One trial: what is to be done, and what came of it.
struct AcceptanceTrial {
  uint32_t id = 0;  ///< from 1, in the order in which the trials are done
  TrialKind kind = TrialKind::kLoad;
  int path = 0, ring = 0;                   ///< of the marker under the load, from 1; 0: no place
  std::optional<double> force_n = {};       ///< of the planned load
  std::optional<double> pressure_mpa = {};  ///< that must be inside; none: as it is
  std::string attitude = {};                ///< name of the link's attitude; empty: as it is
  double hold_s = 0;
  int repetition = 1;

  TrialState state = TrialState::kOpen;
  TrialReference reference = {};
  std::optional<TrialReading> unloaded = {}, loaded = {},
                              released = {};  ///< before, during and after the load
};

/// Largest errors with which a link is accepted; 0: not limited.
struct AcceptanceLimits {
  /// Errors of loads below this are compared with this instead: 10 % of 0.3 N is the 0.03 N that a weak load
  /// may be off.
  double force_floor_n = 0.3;
  double force_error = 0.10;      ///< 95th percentile of the error of single loads
  double force_bias = 0.06;       ///< magnitude of the mean relative error
  double place_error_mm = 4;      ///< 95th percentile
  double repeatability = 0.05;    ///< standard deviation of repeated loads, relative
  double ghost_n = 0.03;          ///< after a load was taken off, 95th percentile
  double creep = 0.05;            ///< magnitude of the relative change within a held load
  double pressure_slope = 0.08;   ///< magnitude of the change of the relative force error per kPa
  double attitude_effect = 0.06;  ///< largest difference of mean relative errors between attitudes
  double balance = 0.15;          ///< 95th percentile: resultant of all contacts less the load, by the load
  double pressure_error = 0.03;   ///< relative error of the pressure sensor's gain
  double drift_mm_per_h = 0.5;    ///< of the baseline
};

/// All trials of one acceptance of one link.
struct AcceptanceRecord {
  std::string link = {}, plan = {};  ///< names
  std::string model = {};            ///< name of the link model
  std::string model_hash = {};    ///< Fingerprint of the model's file; empty: not known
  int64_t calibrated_utc_ns = 0;  ///< when the cameras in use were calibrated; 0: not known
  int64_t started_utc_ns = 0, finished_utc_ns = 0;  ///< 0: not finished
  AcceptanceLimits limits = {};
  std::vector<AcceptanceTrial> trials = {};
};

/// The trial that is to be done next; null: none is open.
const AcceptanceTrial* NextTrial(const AcceptanceRecord& record);

}  // namespace taclink

#pragma once

#include <algorithm>
#include <optional>

#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/estimation/camera_evidence.h"
#include "sensing/pipeline/attitude_check.h"
#include "sensing/pipeline/camera_motion.h"
#include "sensing/pipeline/state_estimator.h"
#include "sensing/pipeline/view_obstruction.h"

namespace taclink {

/// Below this share of the markers in sight a link is lost: nothing is measured.
inline constexpr double kLostShare = 0.4;

/// Of so many markers two pictures of one skin may disagree, few of which are wrong labels.
inline double MostApart(const CameraAgreement& agreement) {
  return std::max(7.0, 0.1 * agreement.pairs);
}

/// False: the two pictures are not of one skin. So many lines of sight miss each other that nothing is
/// measured.
inline bool AreOfOneSkin(const CameraAgreement& agreement) {
  return agreement.apart <= MostApart(agreement);
}

/// All that is known of how good a frame's answer is.
struct Evidence {
  const LinkModel& model;
  std::optional<Reason> camera_trouble;       ///< none: both cameras' pictures are there
  std::optional<Reason> camera_warning = {};  ///< of a camera whose picture is there
  CameraAgreement agreement;
  std::optional<Reason> diagnosis = {};               ///< of the cameras; see CameraDiagnosis
  std::optional<MotionDisagreement> motion;           ///< see CameraMotion
  std::optional<CameraId> sees_alone;                 ///< see RestComparison
  std::optional<ViewObstruction> obstruction = {};    ///< see FindViewObstruction
  std::optional<AttitudeDisagreement> attitude = {};  ///< none: measured attitude and skin agree
  double attitude_error_mm = 0;      ///< of a marker, by what is not known of the specific force
  std::optional<Reason> drift;       ///< none: the baseline has not drifted far
  bool is_baseline_forced = false;   ///< taken although something touched or moved
  MeasuredLoads measured;            ///< known loads that the estimate took
  bool is_pressure_measured = true;  ///< false: there is no sensor, or it fell silent
  MeasuredLoads baseline;            ///< known loads of the baseline
  const SkinEstimate& estimate;
};

/// Sets status and reasons of a measured state, here alone; what can't be trusted is taken out of it.
void Judge(const Evidence& evidence, LinkState& state);

}  // namespace taclink

#include "sensing/core/link_state.h"

#include <algorithm>

#include "sensing/core/link_state_fields.h"

namespace taclink {

const char* Name(ReasonId id) {
  switch (id) {
    case ReasonId::kFewMarkers:
      return "few_markers";
    case ReasonId::kCamera:
      return "camera";
    case ReasonId::kNotConverged:
      return "not_converged";
    case ReasonId::kImpossible:
      return "impossible";
    case ReasonId::kNoEquilibrium:
      return "no_equilibrium";
    case ReasonId::kPressureUnknown:
      return "pressure_unknown";
    case ReasonId::kPressureMismatch:
      return "pressure_mismatch";
    case ReasonId::kResidual:
      return "residual";
    case ReasonId::kLabels:
      return "labels";
    case ReasonId::kTooDeep:
      return "too_deep";
    case ReasonId::kBeyondMarkers:
      return "beyond_markers";
    case ReasonId::kEncircled:
      return "encircled";
    case ReasonId::kSparseMarkers:
      return "sparse_markers";
    case ReasonId::kUnsettled:
      return "unsettled";
    case ReasonId::kForceModel:
      return "force_model";
    case ReasonId::kFrozen:
      return "frozen";
    case ReasonId::kLate:
      return "late";
    case ReasonId::kCamerasDisagree:
      return "cameras_disagree";
    case ReasonId::kCamerasMoved:
      return "cameras_moved";
    case ReasonId::kDrift:
      return "drift";
    case ReasonId::kForcedBaseline:
      return "forced_baseline";
    case ReasonId::kAttitudeUnknown:
      return "attitude_unknown";
    case ReasonId::kAttitudeMismatch:
      return "attitude_mismatch";
    case ReasonId::kCamerasSwapped:
      return "cameras_swapped";
    case ReasonId::kFrameRate:
      return "frame_rate";
    case ReasonId::kNoFrames:
      return "no_frames";
    case ReasonId::kWorker:
      return "worker";
  }
  return "unknown";
}

ReasonUnit UnitOf(ReasonId id) {
  switch (id) {
    case ReasonId::kLate:
      return ReasonUnit::kSeconds;
    case ReasonId::kFrameRate:
      return ReasonUnit::kHertz;
    case ReasonId::kPressureMismatch:
      return ReasonUnit::kMegapascals;
    case ReasonId::kAttitudeUnknown:
    case ReasonId::kTooDeep:
    case ReasonId::kSparseMarkers:
    case ReasonId::kUnsettled:
    case ReasonId::kForceModel:
    case ReasonId::kCamerasMoved:
    case ReasonId::kDrift:
      return ReasonUnit::kMillimeters;
    default:
      return ReasonUnit::kNone;
  }
}

bool DoubtsContacts(ReasonId id) {
  switch (id) {
    case ReasonId::kPressureUnknown:
    case ReasonId::kAttitudeUnknown:
    case ReasonId::kTooDeep:
    case ReasonId::kBeyondMarkers:
    case ReasonId::kEncircled:
    case ReasonId::kSparseMarkers:
    case ReasonId::kForceModel:
    case ReasonId::kDrift:
      return false;
    default:
      return true;
  }
}

std::optional<ReasonId> ReasonNamed(std::string_view name) {
  for (int i = 0; i < kReasonCount; ++i) {
    if (name == Name(static_cast<ReasonId>(i))) return static_cast<ReasonId>(i);
  }
  return std::nullopt;
}

bool AreContactsCertain(const LinkState& state) {
  return state.measured() && state.has_forces() &&
         std::ranges::none_of(state.reasons, [](const Reason& reason) { return DoubtsContacts(reason.id); });
}

void LinkState::ClearMeasurement() {
  ResetFields(*this, FieldScope::kMeasurement);
}

}  // namespace taclink

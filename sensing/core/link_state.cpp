#include "sensing/core/link_state.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include "sensing/core/link_state_fields.h"

namespace taclink {

namespace {

// In the order of ReasonId.
constexpr ReasonTraits kReasonTraits[] = {
    {.name = "few_markers", .may_come_of_cameras = true},
    {.name = "camera"},
    {.name = "frozen"},
    {.name = "late", .unit = ReasonUnit::kSeconds},
    {.name = "cameras_disagree", .may_come_of_cameras = true, .may_come_of_baseline = true},
    {.name = "not_converged", .may_come_of_cameras = true, .may_come_of_baseline = true},
    {.name = "impossible", .may_come_of_cameras = true, .may_come_of_baseline = true},
    {.name = "no_equilibrium"},
    {.name = "pressure_unknown", .doubts_contacts = false},
    {.name = "pressure_mismatch", .unit = ReasonUnit::kMegapascals, .may_come_of_baseline = true},
    {.name = "residual", .may_come_of_cameras = true, .may_come_of_baseline = true},
    {.name = "labels", .may_come_of_cameras = true, .may_come_of_baseline = true},
    {.name = "too_deep", .unit = ReasonUnit::kMillimeters, .doubts_contacts = false},
    {.name = "beyond_markers", .doubts_contacts = false},
    {.name = "encircled", .doubts_contacts = false},
    {.name = "sparse_markers", .unit = ReasonUnit::kMillimeters, .doubts_contacts = false},
    {.name = "unsettled", .unit = ReasonUnit::kMillimeters},
    {.name = "force_model", .unit = ReasonUnit::kMillimeters, .doubts_contacts = false},
    {.name = "cameras_moved",
     .unit = ReasonUnit::kMillimeters,
     .may_come_of_cameras = true,
     .may_come_of_baseline = true},
    {.name = "drift", .unit = ReasonUnit::kMillimeters, .doubts_contacts = false},
    {.name = "no_frames"},
    {.name = "worker"},
    {.name = "forced_baseline"},
    {.name = "attitude_unknown", .unit = ReasonUnit::kMillimeters, .doubts_contacts = false},
    {.name = "attitude_mismatch"},
    {.name = "cameras_swapped"},
    {.name = "frame_rate", .unit = ReasonUnit::kHertz},
    {.name = "image_contrast", .doubts_contacts = false},
    {.name = "late_frame", .unit = ReasonUnit::kSeconds},
    {.name = "temporal_smoothing"},
    {.name = "stiffness_mismatch", .doubts_contacts = false},
};
static_assert(std::size(kReasonTraits) == kReasonCount);

}  // namespace

const ReasonTraits& TraitsOf(ReasonId id) {
  static constexpr ReasonTraits kUnknown;
  const auto index = static_cast<size_t>(id);
  return index < std::size(kReasonTraits) ? kReasonTraits[index] : kUnknown;
}

std::optional<ReasonId> ReasonNamed(std::string_view name) {
  for (int i = 0; i < kReasonCount; ++i) {
    if (name == Name(static_cast<ReasonId>(i))) return static_cast<ReasonId>(i);
  }
  return std::nullopt;
}

bool AreContactsCertain(const LinkState& state) {
  return state.measured() && state.has_forces() &&
         std::ranges::none_of(state.reasons,
                              [](const Reason& reason) { return TraitsOf(reason.id).doubts_contacts; });
}

void Degrade(LinkState& state, Reason reason) {
  if (state.status != LinkStatus::kOk && state.status != LinkStatus::kDegraded) return;
  state.status = LinkStatus::kDegraded;
  if (state.status_reason.empty()) state.status_reason = reason.text;
  state.reasons.push_back(std::move(reason));
}

double LinkState::total_magnitude_n() const {
  if (!has_forces()) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0;
  for (const Contact& contact : contacts) sum += contact.magnitude_n();
  return sum;
}

void LinkState::ClearMeasurement() {
  ResetFields(*this, FieldScope::kMeasurement);
}

}  // namespace taclink

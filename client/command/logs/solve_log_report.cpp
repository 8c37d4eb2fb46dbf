#include "client/command/logs/solve_log_report.h"

#include <cmath>
#include <utility>

#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::command {
namespace {

// Times, and that the frame was late, are of the server that recorded: they are no part of the solution.
bool IsSame(const std::string& recorded_bytes, const v1::LinkFrame& recorded, v1::LinkFrame solved) {
  *solved.mutable_stage_times() = recorded.stage_times();
  for (const v1::StatusReason& reason : recorded.status_reasons()) {
    if (reason.reason() != v1::REASON_LATE_FRAME) continue;
    // As Degrade of sensing/core/link_state.h.
    if (solved.status() != v1::LINK_STATUS_OK && solved.status() != v1::LINK_STATUS_DEGRADED) break;
    solved.set_status(v1::LINK_STATUS_DEGRADED);
    if (solved.status_reason().empty()) solved.set_status_reason(reason.text());
    *solved.add_status_reasons() = reason;
  }
  return solved.SerializeAsString() == recorded_bytes;
}

void AddMarkers(const v1::LinkFrame& a, const v1::LinkFrame& b, Spread& shift_mm) {
  if (a.positions_m_size() != b.positions_m_size()) return;
  for (int i = 0; i + 2 < a.positions_m_size(); i += 3) {
    double square = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double off =
          static_cast<double>(b.positions_m(i + axis)) - static_cast<double>(a.positions_m(i + axis));
      square += off * off;
    }
    shift_mm.Add(std::sqrt(square) / wire::kMetresPerMm);
  }
}

void NoteBreak(const Baseline& recorded, const Baseline& solved, uint64_t sequence, double after_s,
               std::vector<BaselineBreak>& breaks) {
  const auto key = [](const Baseline& baseline) { return std::pair(baseline.origin, baseline.taken_utc_ns); };
  if (!breaks.empty() && key(breaks.back().recorded) == key(recorded) &&
      key(breaks.back().solved) == key(solved))
    return;
  breaks.push_back({.sequence = sequence, .after_s = after_s, .recorded = recorded, .solved = solved});
}

}  // namespace

void Compare(const v1::LinkFrame& recorded, const std::string& recorded_bytes, double after_s,
             const v1::LinkFrame& solved, LinkReport& report) {
  ++report.solved;
  if (IsSame(recorded_bytes, recorded, solved)) ++report.identical;
  const bool then = recorded.positions_m_size() > 0, now = solved.positions_m_size() > 0;
  if (then != now) ++(then ? report.only_recorded : report.only_solved);
  if (!then || !now) return;
  const Baseline old_baseline = wire::FromWire(recorded.baseline()),
                 baseline = wire::FromWire(solved.baseline());
  const bool comparable =
      old_baseline.origin == baseline.origin && old_baseline.taken_utc_ns == baseline.taken_utc_ns;
  if (!comparable) NoteBreak(old_baseline, baseline, recorded.sequence(), after_s, report.breaks);
  FrameDifferences& differences = comparable ? report.same_baseline : report.other_baseline;
  ++differences.frames;
  AddMarkers(recorded, solved, differences.marker_mm);
  if (solved.has_total_force_n() && recorded.has_total_force_n())
    differences.force_n.Add(
        (wire::FromWire(solved.total_force_n(), 1) - wire::FromWire(recorded.total_force_n(), 1)).norm());
  if (recorded.contacts_size() != solved.contacts_size()) ++differences.other_contacts;
}

}  // namespace taclink::command

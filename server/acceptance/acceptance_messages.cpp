#include "server/acceptance/acceptance_messages.h"

#include <algorithm>
#include <optional>

#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

using wire::kMetresPerMm;
using wire::kPascalsPerMpa;

// The API's enumerators have the same order, from 1.
template <typename Wire, typename Value>
Wire ToWire(Value value) {
  return static_cast<Wire>(static_cast<int>(value) + 1);
}
template <typename Value>
Value ValueOf(int number, Value last) {
  const int value = number - 1;
  return value < 0 || value > static_cast<int>(last) ? Value{} : static_cast<Value>(value);
}

void Write(const TrialReference& reference, v1::TrialReference& out) {
  if (reference.force_n) out.set_force_n(*reference.force_n);
  out.set_force_sigma_n(reference.force_sigma_n);
  if (reference.place_mm) wire::Fill(*reference.place_mm, kMetresPerMm, *out.mutable_place_m());
  if (reference.direction) wire::Fill(*reference.direction, 1, *out.mutable_direction());
  if (reference.pressure_mpa) out.set_pressure_pa(*reference.pressure_mpa * kPascalsPerMpa);
}

void Write(const TrialReading& reading, v1::TrialReading& out) {
  out.set_utc_ns(reading.utc_ns);
  out.set_duration_s(reading.duration_s);
  out.set_frames(static_cast<uint32_t>(reading.frames));
  out.set_usable_frames(static_cast<uint32_t>(reading.usable));
  out.set_has_contact(reading.has_contact);
  out.set_force_n(reading.force_n);
  out.set_force_sd_n(reading.force_sd_n);
  if (reading.stated_sigma_n) out.set_stated_sigma_n(*reading.stated_sigma_n);
  wire::Fill(reading.center_mm, kMetresPerMm, *out.mutable_center_m());
  wire::Fill(reading.total_force_n, 1, *out.mutable_total_force_n());
  out.set_others_n(reading.others_n);
  if (reading.pressure_mpa) out.set_pressure_pa(*reading.pressure_mpa * kPascalsPerMpa);
  out.set_baseline_drift_m(reading.baseline_drift_mm * kMetresPerMm);
  out.set_baseline_utc_ns(reading.baseline_utc_ns);
  for (const taclink::ReadingReason& reason : reading.reasons) {
    v1::ReadingReason& message = *out.add_reasons();
    message.set_name(taclink::Name(reason.id));
    message.set_frames(static_cast<uint32_t>(reason.frames));
    message.set_text(reason.text);
  }
  for (const taclink::HeldSample& sample : reading.held) {
    v1::HeldSample& message = *out.add_held();
    message.set_time_s(sample.time_s);
    message.set_force_n(sample.force_n);
  }
}

TrialReading ReadingFrom(const v1::TrialReading& message) {
  TrialReading reading{.utc_ns = message.utc_ns(),
                       .duration_s = message.duration_s(),
                       .frames = static_cast<int>(message.frames()),
                       .usable = static_cast<int>(message.usable_frames()),
                       .has_contact = message.has_contact(),
                       .force_n = message.force_n(),
                       .force_sd_n = message.force_sd_n(),
                       .center_mm = wire::FromWire(message.center_m(), 1 / kMetresPerMm),
                       .total_force_n = wire::FromWire(message.total_force_n(), 1),
                       .others_n = message.others_n(),
                       .baseline_drift_mm = message.baseline_drift_m() / kMetresPerMm,
                       .baseline_utc_ns = message.baseline_utc_ns()};
  if (message.has_stated_sigma_n()) reading.stated_sigma_n = message.stated_sigma_n();
  if (message.has_pressure_pa()) reading.pressure_mpa = message.pressure_pa() / kPascalsPerMpa;
  for (const v1::ReadingReason& reason : message.reasons()) {
    const auto id = ReasonNamed(reason.name());
    if (id) reading.reasons.push_back({*id, static_cast<int>(reason.frames()), reason.text()});
  }
  for (const v1::HeldSample& sample : message.held())
    reading.held.push_back({sample.time_s(), sample.force_n()});
  return reading;
}

void Write(const AcceptanceTrial& trial, v1::AcceptanceTrial& out) {
  out.set_id(trial.id);
  out.set_kind(ToWire<v1::TrialKind>(trial.kind));
  out.set_path(static_cast<uint32_t>(trial.path));
  out.set_ring(static_cast<uint32_t>(trial.ring));
  if (trial.force_n) out.set_force_n(*trial.force_n);
  if (trial.pressure_mpa) out.set_pressure_pa(*trial.pressure_mpa * kPascalsPerMpa);
  out.set_attitude(trial.attitude);
  out.set_hold_s(trial.hold_s);
  out.set_repetition(static_cast<uint32_t>(trial.repetition));
  out.set_state(ToWire<v1::TrialState>(trial.state));
  Write(trial.reference, *out.mutable_reference());
  if (trial.unloaded) Write(*trial.unloaded, *out.mutable_unloaded());
  if (trial.loaded) Write(*trial.loaded, *out.mutable_loaded());
  if (trial.released) Write(*trial.released, *out.mutable_released());
}

AcceptanceTrial TrialFrom(const v1::AcceptanceTrial& message) {
  AcceptanceTrial trial{.id = message.id(),
                        .kind = ValueOf(message.kind(), TrialKind::kPressure),
                        .path = static_cast<int>(message.path()),
                        .ring = static_cast<int>(message.ring()),
                        .attitude = message.attitude(),
                        .hold_s = message.hold_s(),
                        .repetition = static_cast<int>(message.repetition()),
                        .state = ValueOf(message.state(), TrialState::kSkipped),
                        .reference = server::FromWire(message.reference())};
  if (message.has_force_n()) trial.force_n = message.force_n();
  if (message.has_pressure_pa()) trial.pressure_mpa = message.pressure_pa() / kPascalsPerMpa;
  if (message.has_unloaded()) trial.unloaded = ReadingFrom(message.unloaded());
  if (message.has_loaded()) trial.loaded = ReadingFrom(message.loaded());
  if (message.has_released()) trial.released = ReadingFrom(message.released());
  return trial;
}

v1::AcceptanceVerdict VerdictOf(const AcceptanceReport& report) {
  switch (report.verdict) {
    case Verdict::kPassed:
      return v1::ACCEPTANCE_VERDICT_PASSED;
    case Verdict::kFailed:
      return v1::ACCEPTANCE_VERDICT_FAILED;
    case Verdict::kUndecided:
    case Verdict::kNotMeasured:
    case Verdict::kUnlimited:
      return v1::ACCEPTANCE_VERDICT_UNDECIDED;
  }
  return v1::ACCEPTANCE_VERDICT_UNSPECIFIED;
}

}  // namespace

void Fill(const AcceptanceRecord& record, v1::Acceptance& out) {
  out.set_link(record.link);
  out.set_plan(record.plan);
  out.set_model(record.model);
  out.set_model_hash(record.model_hash);
  out.set_calibrated_utc_ns(record.calibrated_utc_ns);
  out.set_started_utc_ns(record.started_utc_ns);
  out.set_finished_utc_ns(record.finished_utc_ns);
  for (const AcceptanceTrial& trial : record.trials) Write(trial, *out.add_trials());
  if (const AcceptanceTrial* next = NextTrial(record)) out.set_next_trial(next->id);
}

void Fill(const AcceptanceReport& report, v1::AcceptanceReport& out) {
  out.set_verdict(VerdictOf(report));
  for (const taclink::AcceptanceQuantity& quantity : report.quantities) {
    v1::AcceptanceQuantity& message = *out.add_quantities();
    message.set_id(quantity.id);
    message.set_label(quantity.label);
    message.set_unit(quantity.unit);
    message.set_value(quantity.value);
    if (quantity.low) message.set_low(*quantity.low);
    if (quantity.high) message.set_high(*quantity.high);
    message.set_loads(static_cast<uint32_t>(quantity.loads));
    if (quantity.limit > 0) message.set_limit(quantity.limit);
    message.set_verdict(ToWire<v1::QuantityVerdict>(quantity.verdict));
  }
  for (const taclink::AcceptanceFinding& finding : report.findings) {
    v1::AcceptanceFinding& message = *out.add_findings();
    message.set_id(Name(finding.id));
    message.set_text(finding.text);
  }
  out.set_measured(static_cast<uint32_t>(report.measured));
  out.set_skipped(static_cast<uint32_t>(report.skipped));
  out.set_open(static_cast<uint32_t>(report.open));
  out.set_withheld(static_cast<uint32_t>(report.withheld));
  out.set_missed(static_cast<uint32_t>(report.missed));
}

v1::AcceptanceSummary SummaryOf(const AcceptanceRecord& record, const AcceptanceReport& report) {
  constexpr double kOfPercent = 0.01;
  v1::AcceptanceSummary summary;
  summary.set_finished_utc_ns(record.finished_utc_ns);
  summary.set_verdict(VerdictOf(report));
  summary.set_loads(static_cast<uint32_t>(report.loads.size()));
  const auto measured = [&](const char* id) {
    const auto* quantity = report.Quantity(id);
    return quantity != nullptr && quantity->loads > 0 ? quantity : nullptr;
  };
  if (const auto* bias = measured("force_bias")) {
    summary.set_force_bias(kOfPercent * bias->value);
    if (bias->low && bias->high)
      summary.set_force_bias_half_width(kOfPercent * (*bias->high - *bias->low) / 2);
  }
  if (const auto* error = measured("force_error")) summary.set_force_error_95(kOfPercent * error->value);
  if (const auto* place = measured("place_error")) summary.set_place_error_95_m(place->value * kMetresPerMm);
  for (const taclink::AcceptanceFinding& finding : report.findings) summary.add_findings(finding.text);
  return summary;
}

AcceptanceRecord FromWire(const v1::Acceptance& message) {
  AcceptanceRecord record{.link = message.link(),
                          .plan = message.plan(),
                          .model = message.model(),
                          .model_hash = message.model_hash(),
                          .calibrated_utc_ns = message.calibrated_utc_ns(),
                          .started_utc_ns = message.started_utc_ns(),
                          .finished_utc_ns = message.finished_utc_ns()};
  for (const v1::AcceptanceTrial& trial : message.trials()) record.trials.push_back(TrialFrom(trial));
  return record;
}

TrialReference FromWire(const v1::TrialReference& message, const Rigid3& base_from_link) {
  TrialReference reference{.force_sigma_n = message.force_sigma_n()};
  const Rigid3 link_from_frame = message.in_base_frame() ? base_from_link.Inverse() : Rigid3{};
  if (message.has_force_n()) reference.force_n = message.force_n();
  if (message.has_place_m())
    reference.place_mm = link_from_frame * wire::FromWire(message.place_m(), 1 / kMetresPerMm);
  if (message.has_direction()) {
    const Vec3 direction = link_from_frame.rotation * wire::FromWire(message.direction(), 1);
    if (direction.norm() > 0) reference.direction = direction.normalized();
  }
  if (message.has_pressure_pa()) reference.pressure_mpa = message.pressure_pa() / kPascalsPerMpa;
  return reference;
}

}  // namespace taclink::server

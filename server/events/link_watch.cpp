#include "server/events/link_watch.h"

#include <cctype>
#include <cmath>
#include <utility>

#include "sensing/core/marker_text.h"

namespace taclink::server {
namespace {

// A status that gets better for a frame or two is not told.
constexpr int64_t kBetterForNs = 200'000'000;

// "37 of 240 markers seen" is no news after "38 of 240 markers seen".
std::string WithoutNumbers(const std::string& reason) {
  std::string text;
  for (const char c : reason) {
    if (std::isdigit(static_cast<unsigned char>(c)) == 0) text += c;
  }
  return text;
}

// From good to bad.
int Rank(LinkStatus status) {
  switch (status) {
    case LinkStatus::kOk:
      return 0;
    case LinkStatus::kDegraded:
      return 1;
    default:
      return 2;
  }
}

}  // namespace

LinkWatch::LinkWatch(size_t link, const LinkRules& rules, const MarkerGrid& grid, const EventOptions& options,
                     double length_unit)
    : link_(link), paths_(grid.paths), options_(options), contacts_(options, length_unit) {
  forces_.emplace_back("", rules.thresholds);
  for (const Region& region : rules.regions)
    forces_.emplace_back(region.name, region.thresholds, MarkersOf(region, grid));
}

ForceWatch* LinkWatch::Find(const std::string& region) {
  for (ForceWatch& force : forces_) {
    if (force.name() == region) return &force;
  }
  return nullptr;
}

Event LinkWatch::About(const LinkState& state, EventKind kind) const {
  Event event;
  event.kind = kind;
  event.link = link_;
  event.frame_sequence = state.sequence;
  event.exposure_utc_ns = state.times.exposure_utc_ns;
  event.exposure_ns = state.times.exposure_monotonic_ns;
  event.published_ns = state.times.published_ns;
  event.frame_status = state.status;
  for (const Reason& reason : state.reasons) event.frame_reasons.push_back(reason.id);
  return event;
}

void LinkWatch::Take(const LinkState& state, std::vector<Event>& events) {
  TakeStatus(state, events);
  TakeBaseline(state, events);
  contacts_told_.clear();
  contacts_.Take(state, contacts_told_);
  for (auto& told : contacts_told_) {
    events.push_back(About(state, told.kind));
    events.back().detail = std::move(told.detail);
  }
  levels_told_.clear();
  for (ForceWatch& force : forces_) force.Take(state, levels_told_);
  for (auto& told : levels_told_) {
    events.push_back(About(state, EventKind::kForceLevel));
    events.back().detail = std::move(told);
  }
}

void LinkWatch::TakeStatus(const LinkState& state, std::vector<Event>& events) {
  const int64_t now_ns = state.times.published_ns;
  if (Rank(state.status) >= Rank(status_)) better_since_ns_ = 0;
  if (state.status == status_) {
    if (state.status_reason == reason_ || WithoutNumbers(state.status_reason) == WithoutNumbers(reason_))
      return;
  } else if (Rank(state.status) < Rank(status_)) {
    if (better_since_ns_ == 0) better_since_ns_ = now_ns;
    if (now_ns - better_since_ns_ < kBetterForNs) return;
  }
  events.push_back(About(state, EventKind::kLinkStatus));
  events.back().detail = StatusDetail{state.status, status_, state.status_reason};
  status_ = state.status;
  reason_ = state.status_reason;
  better_since_ns_ = 0;
}

void LinkWatch::TakeBaseline(const LinkState& state, std::vector<Event>& events) {
  const Baseline& baseline = state.baseline;
  if (baseline.origin == BaselineOrigin::kNone) return;
  if (baseline.taken_utc_ns != baseline_utc_ns_) {
    baseline_utc_ns_ = baseline.taken_utc_ns;
    drift_mm_ = 0;
    // Those that were asked for are told by who carried them out.
    if (baseline.origin == BaselineOrigin::kStart) {
      std::string outcome = "rest shape taken from the first pictures";
      if (const std::vector<int>& missing = baseline.missing_markers; !missing.empty())
        outcome += "; no camera shows the markers on " + MarkerText(missing, paths_) +
                   ": forces near them are less accurate";
      events.push_back(About(state, EventKind::kBaseline));
      events.back().detail = Operation{.who = "server", .outcome = std::move(outcome), .values = {}};
    }
  }
  const double step_mm = baseline.drift_mm - drift_mm_;
  if (std::abs(step_mm) < options_.drift_step_mm) return;
  drift_mm_ = baseline.drift_mm;
  events.push_back(About(state, EventKind::kDrift));
  events.back().detail = DriftDetail{.drift_mm = baseline.drift_mm, .step_mm = step_mm};
}

}  // namespace taclink::server

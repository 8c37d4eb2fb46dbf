#include "server/events/contact_watch.h"

#include <algorithm>
#include <cmath>

namespace taclink::server {
namespace {

// Less is no news.
constexpr double kLeastChangeN = 0.01, kLeastChangePart = 0.05, kLeastMoveMm = 1;

int64_t Ns(double seconds) {
  return static_cast<int64_t>(seconds * 1e9);
}

}  // namespace

ContactWatch::Track& ContactWatch::TrackOf(const Contact& contact) {
  for (Track& track : tracks_) {
    if (track.current == contact.id) return track;
  }
  Track* nearest = nullptr;
  double best_mm = same_place_mm_;
  for (Track& track : tracks_) {
    const double off_mm = (track.contact.center_mm - contact.center_mm).norm();
    if (track.seen || off_mm >= best_mm) continue;
    best_mm = off_mm;
    nearest = &track;
  }
  if (nearest != nullptr) return *nearest;
  tracks_.push_back({.id = contact.id});
  return tracks_.back();
}

bool ContactWatch::UpdateIsDue(const Track& track, int64_t now_ns) const {
  if (now_ns - track.told_ns < Ns(1 / options_.update_rate_hz)) return false;
  const double change_n = std::abs(track.contact.magnitude_n() - track.told_n);
  return change_n >= std::max(kLeastChangeN, kLeastChangePart * track.told_n) ||
         (track.contact.center_mm - track.told_mm).norm() >= kLeastMoveMm;
}

void ContactWatch::Tell(EventKind kind, Track& track, int64_t now_ns, std::vector<Told>& told) const {
  const Contact& contact = track.contact;
  track.told_ns = now_ns;
  track.told_n = contact.magnitude_n();
  track.told_mm = contact.center_mm;
  told.push_back({kind,
                  {.id = track.id,
                   .center_mm = contact.center_mm,
                   .normal = contact.normal,
                   .force_n = contact.force_n,
                   .normal_force_n = contact.normal_force_n,
                   .peak_n = track.peak_n,
                   .duration_s = static_cast<double>(now_ns - track.begin_ns) * 1e-9,
                   .end_reason = {}}});
}

void ContactWatch::Match(const Contact& contact, int64_t now_ns) {
  Track& track = TrackOf(contact);
  track.current = contact.id;
  track.seen = true;
  track.contact = contact;
  track.contact.markers.clear();
  const double force_n = contact.magnitude_n();
  track.peak_n = std::max(track.peak_n, force_n);
  if (force_n >= options_.end_n) track.strong_ns = now_ns;
}

void ContactWatch::EndThoseGone(int64_t now_ns, std::vector<Told>& told) {
  for (Track& track : tracks_) {
    if (!track.begun || now_ns - track.strong_ns < Ns(options_.release_s)) continue;
    Tell(EventKind::kContactEnd, track, now_ns, told);
    told.back().detail.duration_s = static_cast<double>(track.strong_ns - track.begin_ns) * 1e-9;
    told.back().detail.end_reason = new_baseline_ ? "new baseline" : "released";
    track.begun = track.seen = false;
  }
}

void ContactWatch::Take(const LinkState& state, std::vector<Told>& told) {
  const int64_t now_ns = state.times.published_ns;
  const bool is_certain = AreContactsCertain(state);
  if (state.measured() && state.baseline.taken_utc_ns != baseline_utc_ns_) {
    baseline_utc_ns_ = state.baseline.taken_utc_ns;
    new_baseline_ = !tracks_.empty();
  }
  for (Track& track : tracks_) {
    track.seen = std::any_of(state.contacts.begin(), state.contacts.end(),
                             [&](const Contact& contact) { return contact.id == track.current; });
    // A link that begins again numbers its contacts again: what comes back is known by its place alone.
    if (!track.seen && !is_certain) track.current = 0;
  }
  for (const Contact& contact : state.contacts) Match(contact, now_ns);
  // Ends come first: what begins in the same frame may have the number of one that ends.
  if (is_certain) EndThoseGone(now_ns, told);
  for (Track& track : tracks_) {
    if (track.begun && track.seen && UpdateIsDue(track, now_ns)) {
      Tell(EventKind::kContactUpdate, track, now_ns, told);
    } else if (!track.begun && track.seen && is_certain && track.contact.magnitude_n() >= options_.begin_n) {
      track.begun = true;
      track.begin_ns = now_ns;
      Tell(EventKind::kContactBegin, track, now_ns, told);
    }
  }
  std::erase_if(tracks_, [](const Track& track) { return !track.begun && !track.seen; });
  new_baseline_ = new_baseline_ && !tracks_.empty();
}

}  // namespace taclink::server

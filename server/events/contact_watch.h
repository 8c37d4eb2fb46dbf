#pragma once

#include <cstdint>
#include <vector>

#include "sensing/core/contact.h"
#include "sensing/core/link_state.h"
#include "server/events/event.h"

namespace taclink::server {

/// Begins, updates and ends of one link's contacts. A contact that is gone for a moment, or comes back under
/// another id at the same place, goes on. In frames that leave it open which contacts there are, none begins
/// or ends (AreContactsCertain).
class ContactWatch {
 public:
  /// `length_unit`: LengthUnit of the link's model.
  ContactWatch(const EventOptions& options, double length_unit)
      : options_(options), same_place_mm_(kSameContactMm * length_unit) {}

  struct Told {
    EventKind kind;
    ContactDetail detail;
  };
  void Take(const LinkState& state, std::vector<Told>& told);

 private:
  struct Track {
    uint64_t id = 0;       // that clients know
    uint64_t current = 0;  // in the newest frame that had it; 0: known by its place alone
    bool begun = false;
    bool seen = false;  // in the frame in work
    int64_t begin_ns = 0, strong_ns = 0, told_ns = 0;
    double peak_n = 0, told_n = 0;
    Vec3 told_mm = Vec3::Zero();
    Contact contact = {};  // without its markers
  };

  Track& TrackOf(const Contact& contact);
  void Match(const Contact& contact, int64_t now_ns);
  void EndThoseGone(int64_t now_ns, std::vector<Told>& told);
  void Tell(EventKind kind, Track& track, int64_t now_ns, std::vector<Told>& told) const;
  bool UpdateIsDue(const Track& track, int64_t now_ns) const;

  const EventOptions options_;
  const double same_place_mm_;  // a contact that comes back closer than this goes on
  std::vector<Track> tracks_;
  int64_t baseline_utc_ns_ = 0;
  bool new_baseline_ = false;  // and contacts of the old one have not ended yet
};

}  // namespace taclink::server

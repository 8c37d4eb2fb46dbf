#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/events/contact_watch.h"
#include "server/events/event.h"
#include "server/events/force_watch.h"

namespace taclink::server {

/// What happens to one link, told from its states. One thread at a time.
class LinkWatch {
 public:
  /// `length_unit`: LengthUnit of the link's model.
  LinkWatch(size_t link, const LinkRules& rules, const MarkerGrid& grid, const EventOptions& options,
            double length_unit = 1);

  /// Appends what the state has of news.
  void Take(const LinkState& state, std::vector<Event>& events);

  /// `region` empty: the whole link. Null: there is none of that name.
  ForceWatch* Find(const std::string& region);
  /// The whole link, then its regions.
  const std::vector<ForceWatch>& forces() const { return forces_; }

 private:
  Event About(const LinkState& state, EventKind kind) const;
  void TakeStatus(const LinkState& state, std::vector<Event>& events);
  void TakeBaseline(const LinkState& state, std::vector<Event>& events);

  const size_t link_;
  const int paths_;  // of markers
  const EventOptions options_;
  ContactWatch contacts_;
  std::vector<ForceWatch> forces_;

  LinkStatus status_ = LinkStatus::kStarting;  // that was told
  std::string reason_;                         // likewise, without its numbers
  int64_t better_since_ns_ = 0;                // 0: not better
  int64_t baseline_utc_ns_ = 0;
  double drift_mm_ = 0;  // that was told

  std::vector<ContactWatch::Told> contacts_told_;  // scratch
  std::vector<ForceLevelDetail> levels_told_;
};

}  // namespace taclink::server

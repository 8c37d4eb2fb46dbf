#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "sensing/core/clock.h"
#include "server/events/audit_log.h"
#include "server/events/event.h"
#include "server/events/event_history.h"
#include "server/events/link_watch.h"
#include "server/hub/hub.h"
#include "server/process/clock_watch.h"

namespace taclink::server {

struct WatchedLink {
  std::string name;
  LinkRules rules;
  MarkerGrid grid;
  double length_unit = 1;  ///< LengthUnit of its model
};

/// A force level's rule and how it stands.
struct LevelReport {
  std::string region;  ///< empty: the whole link
  Thresholds thresholds;
  ForceLevel level = ForceLevel::kNormal;
  double force_n = 0;
};

/// Turns what the hub publishes, and what is asked of the links, into events. Its own thread, a subscriber
/// like any other: it can be too slow, and then says so by an event; it never keeps a link.
class EventEngine {
 public:
  EventEngine(Hub& hub, std::vector<WatchedLink> links, const EventOptions& options, Clock& clock);
  ~EventEngine();

  /// Frames wait for the engine from now on; Start does it where it was not done.
  void Subscribe();
  void Start();
  /// What was asked of it until now is still told and audited. May be called twice.
  void Stop();

  EventHistory& history() { return history_; }

  /// Something was asked of a link (none: of the whole arm). Any thread, at once: it is told and audited by
  /// the engine's thread. Of more than 1024 that wait, the newest are left out, which the log says.
  void Post(EventKind kind, std::optional<size_t> link, Operation operation);
  /// Something that is no event of the arm, but for the audit: `what` it is about. Otherwise likewise.
  void Audit(const std::string& what, Operation operation);

  /// In force from the next frame on; told and audited. Errors: kInvalidArgument, kNotFound (no such region).
  Result<void> SetThresholds(size_t link, const std::string& region, const Thresholds& thresholds,
                             const std::string& who);
  /// The whole link, then its regions.
  std::vector<LevelReport> Levels(size_t link) const;
  const WatchedLink& link(size_t link) const { return links_[link]; }

 private:
  struct Signal;
  struct Posted {
    std::optional<EventKind> kind;  // none: for the audit only
    std::string what;               // the kind's name, or what the audit is about
    std::optional<size_t> link;
    Operation operation;
  };

  void Take(Posted posted);
  void Run(const std::stop_token& stop);
  void Drain();
  void TakePosts();
  void TakeFrames();
  void TellLostFrames();
  void TellClockStep();
  void Raise(Event event);

  // Constant after construction.
  Hub& hub_;
  Clock& clock_;
  const std::vector<WatchedLink> links_;
  const EventOptions options_;
  const std::shared_ptr<Signal> signal_;
  std::unique_ptr<Subscription> subscription_;  // constant once the thread runs

  EventHistory history_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<LinkWatch> watches_;  // by link
  std::vector<Posted> posts_;

  // Used by the engine's thread only.
  AuditLog audit_;
  std::vector<Event> events_;
  std::vector<uint64_t> lost_told_;  // by link
  uint64_t all_lost_told_ = 0;
  int64_t beat_ns_ = 0;
  ClockWatch clock_watch_;

  std::jthread thread_;
};

}  // namespace taclink::server

#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/events/event.h"

namespace taclink::server {

class EventCursor;

/// The newest events of this run of the server, numbered. Bounded: the oldest give way.
class EventHistory {
 public:
  /// `run_id`: tells the numbers of this run from those of others.
  EventHistory(size_t capacity, std::string run_id);

  /// Numbers the event, and wakes those who wait.
  void Add(Event event);
  /// Lets every cursor say how far it is.
  void Beat();

  const std::string& run_id() const { return run_id_; }
  size_t capacity() const { return ring_.size(); }
  uint64_t newest() const;  ///< 0: none yet
  uint64_t oldest() const;  ///< kept; newest + 1: none

 private:
  friend class EventCursor;
  uint64_t Oldest() const { return newest_ < ring_.size() ? 1 : newest_ - ring_.size() + 1; }
  std::vector<std::function<void()>> TakeWaiting();

  // Constant after construction.
  const std::string run_id_;
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<EventPtr> ring_;  // sequence % size is its place
  uint64_t newest_ = 0;
  uint64_t beats_ = 0;
  std::vector<EventCursor*> cursors_;
};

struct EventFilter {
  std::vector<bool> links = {};  ///< by link; empty: all. Events of the whole arm pass.
  std::array<bool, kEventKinds> kinds = {};
  bool all_kinds = true;

  bool Passes(const Event& event) const;
};

/// One reader's place in the history; a reader that is too slow loses events and is told how many. One thread
/// at a time.
class EventCursor {
 public:
  /// Begins behind event number `after`. `notify` is called outside any lock when there is something after
  /// Next had nothing; one call may still be under way when the cursor is destroyed. The history must outlive
  /// it.
  EventCursor(EventHistory& history, uint64_t after, EventFilter filter, std::function<void()> notify);
  ~EventCursor();
  EventCursor(const EventCursor&) = delete;
  EventCursor& operator=(const EventCursor&) = delete;

  struct Step {
    EventPtr event;       ///< the next one; null: none
    bool status = false;  ///< instead: something to say about the place: events were lost, or a beat
  };
  Step Next();
  /// Counts what is already gone, as the next status will tell it.
  void CatchUp();

  uint64_t position() const { return position_; }  ///< all wanted events up to this one were given out
  uint64_t lost() const { return lost_; }          ///< gone before they were given out, wanted or not

 private:
  friend class EventHistory;
  void SkipWhatIsGone();

  EventHistory& history_;
  const EventFilter filter_;
  const std::function<void()> notify_;
  uint64_t position_;
  uint64_t lost_ = 0, lost_told_ = 0;
  uint64_t beat_told_ = 0;
  bool waiting_ = false;  // guarded by the history's mutex_
};

}  // namespace taclink::server

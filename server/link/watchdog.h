#pragma once

#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "sensing/core/clock.h"
#include "server/link/link_supervisor.h"

namespace taclink::server {

/// The thread that looks after all links.
class Watchdog {
 public:
  Watchdog(Clock& clock, std::chrono::milliseconds interval) : clock_(clock), interval_(interval) {}
  ~Watchdog() { Stop(); }

  /// The supervisors must outlive it or Stop.
  void Start(std::vector<LinkSupervisor*> links);
  void Stop();

  /// Called by the thread after each round in which every supervisor did its part. Quick; any time, any
  /// thread.
  void OnRound(std::function<void()> hook);

 private:
  void Round();

  // Constant after construction.
  Clock& clock_;
  const std::chrono::milliseconds interval_;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::function<void()> hook_;

  std::vector<LinkSupervisor*> links_;  // constant while the thread runs
  std::jthread thread_;
};

}  // namespace taclink::server

#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_state.h"
#include "server/hub.h"
#include "server/link_statistics.h"
#include "server/mailbox.h"
#include "server/source_supervisor.h"
#include "server/state_pool.h"

namespace taclink::server {

/// Takes one pair of pictures the whole way; fills all of the state, whose buffers it reuses. One thread.
using FrameProcessor = std::function<void(const StereoFrame& frame, LinkState& state)>;

struct LinkWorkerOptions {
  /// Longest wait of both threads for anything, so also about how long Stop takes.
  std::chrono::milliseconds poll{100};
  /// Without frames the status is published this often.
  std::chrono::milliseconds heartbeat{1000};
  SupervisorOptions supervisor = {};
};

/// Runs one link: a capture thread (source -> mailbox) and a FEM thread (mailbox -> processor -> hub).
class LinkWorker {
 public:
  LinkWorker(size_t link, std::string name, std::unique_ptr<FrameSource> source, FrameProcessor process,
             Hub& hub, Clock& clock, LinkWorkerOptions options = {});
  ~LinkWorker();

  void Start();
  /// Both threads will end within about a poll and a frame; Stop waits for that. Both may be called twice.
  void RequestStop();
  void Stop();

  LinkStatistics Statistics() const { return statistics_.Snapshot(clock_.MonotonicNs()); }
  SourceCondition source_condition() const { return supervisor_.condition(); }

 private:
  void Capture(const std::stop_token& stop);
  void Solve(const std::stop_token& stop);
  void SolveOne(const StereoFrame& frame);
  void PublishStatusIfDue();
  void Stamp(LinkState& state);

  // Constant after construction.
  const size_t link_;
  const std::string name_;
  const FrameProcessor process_;
  Hub& hub_;
  Clock& clock_;
  const LinkWorkerOptions options_;

  // Shared by the threads, each with its own lock.
  SourceSupervisor supervisor_;
  Mailbox<StereoFrame> mailbox_;
  LinkStatisticsCollector statistics_;
  StatePool pool_;

  // Used by the FEM thread only.
  uint64_t last_sequence_ = 0;
  bool failing_ = false;  // the last frame could not be processed
  int64_t last_published_ns_ = 0;
  uint64_t reported_changes_ = 0;  // of the source's condition

  std::jthread capture_, solve_;
};

}  // namespace taclink::server

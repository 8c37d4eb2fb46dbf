#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_state.h"
#include "server/hub.h"
#include "server/link_processor.h"
#include "server/link_statistics.h"
#include "server/mailbox.h"
#include "server/source_supervisor.h"
#include "server/state_pool.h"

namespace taclink::server {

/// Called on the FEM thread as a calibration goes on, last with its end. False: cancel it; then no more
/// calls.
using CalibrationObserver = std::function<bool(const CalibrationProgress&)>;

struct LinkWorkerOptions {
  /// Longest wait of both threads for anything, so also about how long Stop takes.
  std::chrono::milliseconds poll{100};
  /// Without frames the status is published this often.
  std::chrono::milliseconds heartbeat{1000};
  /// A calibration that gets no frame for so long ends.
  std::chrono::milliseconds calibration_patience{10'000};
  SupervisorOptions supervisor = {};
};

/// Runs one link: a capture thread (source -> mailbox) and a FEM thread (mailbox -> processor -> hub).
class LinkWorker {
 public:
  LinkWorker(size_t link, std::string name, std::unique_ptr<FrameSource> source,
             std::unique_ptr<LinkProcessor> processor, Hub& hub, Clock& clock,
             LinkWorkerOptions options = {});
  ~LinkWorker();

  void Start();
  /// Both threads will end within about a poll and a frame; Stop waits for that. Both may be called twice.
  void RequestStop();
  void Stop();

  /// Errors: kFailedPrecondition (one is under way). All else is told to the observer.
  Result<void> Calibrate(const CalibrationOrder& order, CalibrationObserver observer);

  LinkStatistics Statistics() const { return statistics_.Snapshot(clock_.MonotonicNs()); }
  SourceCondition source_condition() const { return supervisor_.condition(); }

 private:
  void Capture(const std::stop_token& stop);
  void Solve(const std::stop_token& stop);
  void SolveOne(const StereoFrame& frame);
  void PublishStatusIfDue();
  void TakeCalibrationOrder();
  void TellCalibration();
  void EndCalibrationWithout(const Error& error);
  void Stamp(LinkState& state);

  // Constant after construction.
  const size_t link_;
  const std::string name_;
  Hub& hub_;
  Clock& clock_;
  const LinkWorkerOptions options_;

  // Shared by the threads, each with its own lock.
  SourceSupervisor supervisor_;
  Mailbox<StereoFrame> mailbox_;
  LinkStatisticsCollector statistics_;
  StatePool pool_;

  struct CalibrationJob {
    CalibrationOrder order;
    CalibrationObserver observer;
  };
  std::mutex calibration_mutex_;
  // Guarded by calibration_mutex_.
  std::optional<CalibrationJob> ordered_;
  bool calibrating_ = false;  // ordered or under way

  // Used by the FEM thread only.
  const std::unique_ptr<LinkProcessor> processor_;
  std::optional<CalibrationJob> job_;
  int64_t job_frame_ns_ = 0;  // of its last frame
  uint64_t last_sequence_ = 0;
  bool failing_ = false;  // the last frame could not be processed
  int64_t last_published_ns_ = 0;
  uint64_t reported_changes_ = 0;  // of the source's condition

  std::jthread capture_, solve_;
};

}  // namespace taclink::server

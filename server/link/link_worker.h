#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_state.h"
#include "server/attitude/attitude_source.h"
#include "server/hub/hub.h"
#include "server/link/camera_memory.h"
#include "server/link/command_queue.h"
#include "server/link/link_outlet.h"
#include "server/link/link_processor.h"
#include "server/link/mailbox.h"
#include "server/link/source_supervisor.h"
#include "server/link/stage_mark.h"
#include "server/link/tare_desk.h"
#include "server/pressure/pressure_source.h"
#include "server/process/thread_setup.h"

namespace taclink::server {

/// Called on the FEM thread as a calibration goes on, last with its end. False: cancel it; then no more
/// calls.
using CalibrationObserver = std::function<bool(const CalibrationProgress&)>;

/// Called once, on the thread that ran the command or that gave it up.
using CommandObserver = std::function<void(const Result<void>&)>;

struct LinkWorkerOptions {
  /// Longest wait of both threads for anything, so also about how long Stop takes.
  std::chrono::milliseconds poll{100};
  /// Without frames the status is published this often.
  std::chrono::milliseconds heartbeat{1000};
  /// A calibration that gets no further rest pair for so long ends, and a tare that is not complete by then.
  std::chrono::milliseconds calibration_patience{10'000};
  /// So many frames in a row that the processor threw at end the worker: a fresh one may do better.
  int failures = 30;
  std::optional<AgeLimit> age_limit = {};  ///< of frames; none: they may have any age
  RealtimeOptions realtime = {};
  std::shared_ptr<PressureSource> pressure = nullptr;  ///< null: as the frames have it
  std::shared_ptr<AttitudeSource> attitude = nullptr;  ///< likewise
  SupervisorOptions supervisor = {};
};

/// Runs one link: a capture thread (source -> mailbox) and a FEM thread (mailbox -> processor -> outlet),
/// which destroy the source and the processor as they end. Where a shared_ptr holds it, its threads hold it
/// too, so that they can be given up while they hang.
class LinkWorker : public std::enable_shared_from_this<LinkWorker> {
 public:
  LinkWorker(std::string name, std::unique_ptr<FrameSource> source, std::unique_ptr<LinkProcessor> processor,
             std::shared_ptr<LinkOutlet> outlet, Clock& clock, LinkWorkerOptions options = {});
  ~LinkWorker();

  void Start();
  /// Both threads will end within about a poll and a frame; Stop waits for that. Both may be called twice.
  void RequestStop();
  void Stop();

  /// Why a thread ended by itself: an exception left its loop. None: both do as they should.
  std::optional<std::string> failure() const;
  /// Threads that have not ended, after waiting for them for `limit` at most.
  int WaitEnded(std::chrono::milliseconds limit = {});
  /// Gives up a worker that does not end: what its threads still do is ignored, and they keep it alive until
  /// they return, if ever. Only where a shared_ptr holds it.
  void Abandon();
  const StageMark& capture_mark() const { return capture_mark_; }
  const StageMark& fem_mark() const { return fem_mark_; }

  /// Errors: kFailedPrecondition (one is under way). All else is told to the observer.
  Result<void> Calibrate(const CalibrationOrder& order, CalibrationObserver observer);

  /// Likewise.
  Result<void> Tare(const TareOptions& options, TareObserver observer) {
    return tare_.Order(options, std::move(observer));
  }

  /// Stops at the first camera that refuses. Errors: as CommandQueue::Post; all else goes to `done`.
  Result<void> SetCamera(const CameraOrder& order, CommandObserver done);
  /// Uses `estimator` (not null) from the next frame on. Errors: likewise.
  Result<void> UseEstimator(std::shared_ptr<StateEstimator> estimator, CommandObserver done);
  /// Answers the commands of SetCamera and UseEstimator that wait; no further ones are accepted. Any thread.
  void CloseCommands(const Error& why);

  LinkStatistics Statistics() const { return outlet_->Statistics(); }
  SourceCondition source_condition() const { return supervisor_.condition(); }

 private:
  std::jthread StartThread(const char* kind, void (LinkWorker::*loop)(const std::stop_token&));
  void RunThread(void (LinkWorker::*loop)(const std::stop_token&), const std::stop_token& stop);
  void Died(const std::string& reason);
  bool IsCurrent() const { return outlet_->IsCurrent(life_); }  // false: it was given up or replaced
  void EndCalibrationFromOutside(const Error& error);
  void Capture(const std::stop_token& stop);
  void Solve(const std::stop_token& stop);
  void SolveOne(StereoFrame& frame);
  void PublishStatusIfDue();
  void TakeCalibrationOrder();
  void TellCalibration();
  void EndCalibrationIfStuck();
  CalibrationObserver Watching();
  bool MayEndCalibration() { return IsCurrent() && Watching(); }
  CalibrationObserver ForgetCalibration();
  void EndCalibrationWithout(const Error& error);

  // Constant after construction.
  const std::string name_;
  const std::shared_ptr<LinkOutlet> outlet_;
  const uint64_t life_;  // in the outlet
  Clock& clock_;
  const LinkWorkerOptions options_;

  // Shared by the threads, each with its own lock.
  StageMark capture_mark_, fem_mark_;
  SourceSupervisor supervisor_;
  Mailbox<StereoFrame> mailbox_;
  TareDesk tare_;
  CommandQueue<SourceSupervisor> capture_commands_;
  CommandQueue<LinkProcessor> fem_commands_;

  mutable std::mutex end_mutex_;
  std::condition_variable ended_;
  // Guarded by end_mutex_.
  std::optional<std::string> failure_;
  int running_ = 0;  // threads

  std::mutex calibration_mutex_;
  // Guarded by calibration_mutex_.
  std::optional<CalibrationOrder> ordered_;
  CalibrationObserver watching_;  // of the one ordered or under way; null: it was told the end
  bool calibrating_ = false;      // ordered or under way
  bool calibration_closed_ = false;

  // Used by the FEM thread only.
  std::unique_ptr<LinkProcessor> processor_;
  struct CalibrationJob {
    CalibrationOrder order;
    int most_taken = 0;       // rest pairs
    int64_t progress_ns = 0;  // since `most_taken` grew last
    std::string waiting_for;  // why it does not grow; empty: no frame came since
  };
  std::optional<CalibrationJob> job_;
  int failing_ = 0;                // frames in a row that could not be processed
  bool settled_ = false;           // the last frame was measured
  uint64_t reported_changes_ = 0;  // of the source's condition

  std::jthread capture_, solve_;
};

}  // namespace taclink::server

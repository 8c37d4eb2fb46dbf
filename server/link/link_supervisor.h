#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/result.h"
#include "server/config/options.h"
#include "server/link/link_outlet.h"
#include "server/link/link_worker.h"

namespace taclink::server {

/// Make a link's parts again, after its worker died. May throw and may take long.
struct LinkFactories {
  std::function<Result<std::unique_ptr<FrameSource>>()> source = {};
  std::function<Result<std::unique_ptr<LinkProcessor>>()> processor = {};
  /// Makes the forces' part of a processor by another model (none: by tolerance, frame by frame). Empty: the
  /// link has no forces to compute. Errors: a model that does not hold on this link.
  std::function<Result<std::shared_ptr<StateEstimator>>(std::optional<ForceModel>)> estimator = {};
  /// Processors that are made from now on compute so.
  std::function<void(std::optional<ForceModel>)> choose = {};
};

/// How a link's worker does, for those who report it.
struct Supervision {
  enum class State {
    kRunning,
    kOverdue,     ///< a stage takes longer than it may
    kRestarting,  ///< the worker died or was given up; the next one comes
    kResting,     ///< it died too often; waits for Restart
  };
  State state = State::kRunning;
  std::string reason;        ///< what is wrong and what happens next; empty while running
  std::string last_failure;  ///< why the last worker died; empty: none did
  uint64_t restarts = 0;     ///< workers after the first
  uint64_t overruns = 0;     ///< stages that took longer than they may
  uint64_t abandoned = 0;    ///< workers given up since the start; each keeps its memory until it returns
};

/// One link for as long as the server runs: its worker, and a fresh one when that dies or hangs.
class LinkSupervisor {
 public:
  LinkSupervisor(size_t link, std::string name, std::unique_ptr<FrameSource> source,
                 std::unique_ptr<LinkProcessor> processor, LinkFactories factories, Hub& hub, Clock& clock,
                 LinkWorkerOptions options, WatchdogOptions watchdog);
  ~LinkSupervisor();

  void Start();
  /// Stop waits for WatchdogOptions::stop at most. No Check may follow. Both may be called twice.
  void RequestStop();
  void Stop();

  /// Looks after the worker, and publishes the link's status in its place where it can't. Never waits. One
  /// thread.
  void Check();

  /// A fresh worker, also for a resting link. It is there some time after. Any thread.
  void Restart() { order_ = Order::kRestart; }
  /// The same, only if it rests.
  void Wake();

  // Any thread.
  /// Whether threads of workers may still run after Stop that could not be waited for: the process must not
  /// destroy what is global. Those that open cameras or build parts are among DetachedThreads.
  bool LeavesThreads() const { return supervision().abandoned > 0; }
  Supervision supervision() const;
  LinkStatistics Statistics() const { return outlet_->Statistics(); }
  const LinkHistograms& histograms() const { return outlet_->histograms(); }
  const ForceHistory& forces() const { return outlet_->forces(); }
  SourceCondition source_condition() const;
  /// Null between two workers.
  std::shared_ptr<LinkWorker> current() const;
  /// As LinkWorker::Calibrate. Errors: kUnavailable (no worker now).
  Result<void> Calibrate(const CalibrationOrder& order, CalibrationObserver observer);
  /// Likewise.
  Result<void> Tare(const TareOptions& options, TareObserver observer);
  /// Likewise. What was taken lasts until the server ends, also with a fresh worker.
  Result<void> SetCamera(const CameraOrder& order, CommandObserver observer);
  /// At shutdown: answers the commands that wait for a thread, whether or not it hangs, and refuses further
  /// ones, also those for a worker that comes later.
  void CloseCommands(const Error& why);
  /// Computes the forces by `model` (none: by tolerance, frame by frame) from the next frame on, also after a
  /// restart. Builds the model first, which takes up to seconds. `observer` learns whether the FEM thread
  /// adopted it. Errors: kUnavailable (no worker now), kFailedPrecondition (nothing is computed here, or the
  /// model does not hold); then `observer` is not called.
  Result<void> SetForceModel(std::optional<ForceModel> model, CommandObserver observer);

 private:
  enum class Phase { kRunning, kEnding, kBackoff, kBuilding, kResting };
  enum class Order { kNone, kRestart, kWake };
  struct Build;

  void TakeOrder(int64_t now_ns);
  void Judge(int64_t now_ns);
  bool JudgeThread(size_t thread, const StageMark& mark, int64_t now_ns);
  int64_t DeadlineNs(WorkStage stage) const;
  void Died(const std::string& reason, int64_t now_ns);
  void End(int64_t now_ns);
  void AwaitEnd(int64_t now_ns);
  void GiveUp(const std::string& reason, int64_t now_ns);
  void Abandon(LinkWorker& worker);
  void DropWorker();
  void AfterWorker(int64_t now_ns);
  void BeginBuild(int64_t now_ns);
  void AwaitBuild(int64_t now_ns);
  void Enter(Phase phase, Supervision::State state, std::string reason, int64_t now_ns);
  void Report(int64_t now_ns);
  Error NoWorker() const;

  // Constant after construction.
  const std::string name_;
  const LinkFactories factories_;
  Clock& clock_;
  const LinkWorkerOptions options_;
  const WatchdogOptions limits_;
  const std::shared_ptr<LinkOutlet> outlet_;
  const std::shared_ptr<CameraMemory> cameras_ = std::make_shared<CameraMemory>();

  std::atomic<Order> order_ = Order::kNone;

  // Used by Check's thread only.
  Phase phase_ = Phase::kRunning;
  bool restart_at_once_ = false;  // the worker ends by order
  int64_t phase_since_ns_ = 0;
  int64_t started_ns_ = 0;  // the worker
  int64_t retry_at_ns_ = 0;
  int64_t last_check_ns_ = 0;
  int64_t judged_from_ns_ = 0;                 // before that nobody looked
  int deaths_ = 0;                             // in a row
  bool news_ = false;                          // the reason is to be published at once
  std::array<int64_t, 2> counted_since_ns_{};  // of each thread's last overrun
  std::shared_ptr<Build> build_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::shared_ptr<LinkWorker> worker_;
  Supervision supervision_;
  std::optional<Error> closed_;  // why no commands are accepted any more
  SourceCondition past_;         // of the last worker, with all restarts before the current one's
};

}  // namespace taclink::server

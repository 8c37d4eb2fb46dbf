#include "server/link/link_supervisor.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "sensing/core/thread_start.h"
#include "server/process/log.h"
#include "server/process/system_limits.h"

namespace taclink::server {
namespace {

constexpr int64_t kNsPerS = 1'000'000'000;
constexpr int kBlindIntervals = 10;  // the whole program stood still: nobody's fault here

int64_t Ns(std::chrono::milliseconds duration) {
  return std::chrono::nanoseconds(duration).count();
}

double Seconds(int64_t duration_ns) {
  return static_cast<double>(duration_ns) / kNsPerS;
}

}  // namespace

/// Parts for the next worker, being made by a thread of their own.
struct LinkSupervisor::Build {
  Result<void> Make(const LinkFactories& factories) {
    auto made_source = factories.source();
    if (!made_source) return made_source.error();
    auto made_processor = factories.processor();
    if (!made_processor) return made_processor.error();
    source = std::move(*made_source);
    processor = std::move(*made_processor);
    return {};
  }
  void Run(const LinkFactories& factories) {
    try {
      result = Make(factories);
    } catch (const std::exception& e) {
      result = Error{ErrorCode::kInternal, DescribeLimit(e)};
    } catch (...) {
      result = Error{ErrorCode::kInternal, "an exception of unknown type"};
    }
    done = true;
  }

  std::atomic<bool> done = false;
  // Written before done is set, read after.
  Result<void> result;
  std::unique_ptr<FrameSource> source;
  std::unique_ptr<LinkProcessor> processor;
};

LinkSupervisor::LinkSupervisor(size_t link, std::string name, std::unique_ptr<FrameSource> source,
                               std::unique_ptr<LinkProcessor> processor, LinkFactories factories, Hub& hub,
                               Clock& clock, LinkWorkerOptions options, WatchdogOptions watchdog)
    : name_(std::move(name)),
      factories_(std::move(factories)),
      clock_(clock),
      options_(std::move(options)),
      limits_(watchdog),
      outlet_(std::make_shared<LinkOutlet>(link, hub, clock, options_.age_limit)),
      worker_(std::make_shared<LinkWorker>(name_, std::move(source), std::move(processor), outlet_, clock,
                                           options_)) {}

LinkSupervisor::~LinkSupervisor() {
  Stop();
  outlet_->Close();
}

void LinkSupervisor::Start() {
  started_ns_ = last_check_ns_ = judged_from_ns_ = clock_.MonotonicNs();
  current()->Start();
}

void LinkSupervisor::RequestStop() {
  if (const auto worker = current()) worker->RequestStop();
}

void LinkSupervisor::Stop() {
  const auto worker = current();
  if (!worker) return;
  worker->RequestStop();
  if (worker->WaitEnded(limits_.stop) == 0) return worker->Stop();
  Abandon(*worker);
}

void LinkSupervisor::Wake() {
  Order none = Order::kNone;
  order_.compare_exchange_strong(none, Order::kWake);  // a restart that waits does more
}

void LinkSupervisor::Check() {
  const int64_t now_ns = clock_.MonotonicNs();
  if (now_ns - last_check_ns_ > kBlindIntervals * Ns(limits_.interval)) judged_from_ns_ = now_ns;
  last_check_ns_ = now_ns;
  TakeOrder(now_ns);
  switch (phase_) {
    case Phase::kRunning:
      Judge(now_ns);
      break;
    case Phase::kEnding:
      AwaitEnd(now_ns);
      break;
    case Phase::kBackoff:
      if (now_ns >= retry_at_ns_) BeginBuild(now_ns);
      break;
    case Phase::kBuilding:
      AwaitBuild(now_ns);
      break;
    case Phase::kResting:
      break;
  }
  Report(now_ns);
}

void LinkSupervisor::TakeOrder(int64_t now_ns) {
  const Order order = order_.exchange(Order::kNone);
  if (order == Order::kNone || (order == Order::kWake && phase_ != Phase::kResting)) return;
  SPDLOG_INFO("link {}: is started again by order", name_);
  deaths_ = 0;
  if (phase_ == Phase::kRunning) {
    restart_at_once_ = true;
    Enter(Phase::kEnding, Supervision::State::kRestarting, "is started again by order", now_ns);
    End(now_ns);
  } else if (phase_ == Phase::kBackoff || phase_ == Phase::kResting) {
    BeginBuild(now_ns);
  }
}

int64_t LinkSupervisor::DeadlineNs(WorkStage stage) const {
  switch (stage) {
    case WorkStage::kSourceStart:
      return Ns(limits_.source_start);
    case WorkStage::kSourceNext:
      return Ns(options_.poll + limits_.source_next);
    case WorkStage::kFirstFrames:
      return Ns(limits_.first_frames);
    case WorkStage::kFrame:
      return Ns(limits_.frame);
    case WorkStage::kWait:
    case WorkStage::kPublish:
      break;
  }
  return Ns(options_.poll + limits_.other);
}

void LinkSupervisor::Judge(int64_t now_ns) {
  const auto worker = current();
  if (const auto failure = worker->failure()) return Died(*failure, now_ns);
  const bool capture_late = JudgeThread(0, worker->capture_mark(), now_ns);
  if (phase_ != Phase::kRunning) return;
  const bool fem_late = JudgeThread(1, worker->fem_mark(), now_ns);
  if (phase_ != Phase::kRunning || capture_late || fem_late) return;
  if (supervision().state != Supervision::State::kOverdue) return;
  SPDLOG_INFO("link {}: goes on", name_);
  Enter(Phase::kRunning, Supervision::State::kRunning, "", now_ns);
}

// True: it is late.
bool LinkSupervisor::JudgeThread(size_t thread, const StageMark& mark, int64_t now_ns) {
  const auto [stage, since_ns] = mark.Read();
  const int64_t age_ns = now_ns - std::max(since_ns, judged_from_ns_);
  const int64_t deadline_ns = DeadlineNs(stage);
  if (age_ns <= deadline_ns) return false;
  const std::string what =
      fmt::format("{} takes more than the {:g} s it may", Name(stage), Seconds(deadline_ns));
  if (std::exchange(counted_since_ns_[thread], since_ns) != since_ns) {
    {
      const std::lock_guard lock(mutex_);
      ++supervision_.overruns;
    }
    const LogEvent event("stage_overdue", {{"limit_s", Seconds(deadline_ns)}});
    SPDLOG_WARN("link {}: {}", name_, what);
    Enter(Phase::kRunning, Supervision::State::kOverdue, what, now_ns);
  }
  if (age_ns > std::max(Ns(limits_.abandon), deadline_ns))
    GiveUp(fmt::format("hung for {:.0f} s while {}", Seconds(age_ns), Name(stage)), now_ns);
  return true;
}

void LinkSupervisor::Died(const std::string& reason, int64_t now_ns) {
  deaths_ = now_ns - started_ns_ >= Ns(limits_.proven) ? 1 : deaths_ + 1;
  const LogEvent event("worker_failed", {{"deaths", deaths_}});
  SPDLOG_ERROR("link {}: its worker failed, {} in a row: {}", name_, deaths_, reason);
  {
    const std::lock_guard lock(mutex_);
    supervision_.last_failure = reason;
  }
  Enter(Phase::kEnding, Supervision::State::kRestarting,
        "its worker failed: " + reason + "; starting it again", now_ns);
  End(now_ns);
}

void LinkSupervisor::End(int64_t now_ns) {
  if (const auto worker = current()) worker->RequestStop();
  AwaitEnd(now_ns);
}

void LinkSupervisor::AwaitEnd(int64_t now_ns) {
  const auto worker = current();
  if (worker && worker->WaitEnded() > 0) {
    if (now_ns - phase_since_ns_ > Ns(limits_.abandon)) GiveUp("did not end when it was told to", now_ns);
    return;
  }
  if (worker) worker->Stop();  // joins threads that have ended
  DropWorker();
  AfterWorker(now_ns);
}

void LinkSupervisor::GiveUp(const std::string& reason, int64_t now_ns) {
  Abandon(*current());
  if (phase_ == Phase::kEnding) return AfterWorker(now_ns);  // its death is counted
  Died(reason, now_ns);
}

void LinkSupervisor::Abandon(LinkWorker& worker) {
  worker.Abandon();
  const LogEvent event("worker_abandoned");
  SPDLOG_ERROR("link {}: its worker hangs and is given up; its memory stays in use until it returns", name_);
  {
    const std::lock_guard lock(mutex_);
    ++supervision_.abandoned;
  }
  DropWorker();
}

void LinkSupervisor::DropWorker() {
  std::shared_ptr<LinkWorker> worker;  // released after the lock
  const std::lock_guard lock(mutex_);
  if (!worker_) return;
  SourceCondition condition = worker_->source_condition();
  condition.restarts += past_.restarts;
  past_ = std::move(condition);
  worker = std::exchange(worker_, nullptr);
}

void LinkSupervisor::AfterWorker(int64_t now_ns) {
  if (std::exchange(restart_at_once_, false)) return BeginBuild(now_ns);
  const std::string failure = supervision().last_failure;
  if (deaths_ >= limits_.deaths || !factories_.source || !factories_.processor) {
    const std::string reason = fmt::format(
        "its worker failed {} times in a row, last: {}; it rests. When the cause is mended, 'taclink restart "
        "--link {}' or SIGHUP to the server starts it again",
        deaths_, failure, name_);
    const LogEvent event("link_rests", {{"deaths", deaths_}});
    SPDLOG_ERROR("link {}: {}", name_, reason);
    return Enter(Phase::kResting, Supervision::State::kResting, reason, now_ns);
  }
  const int doublings = std::clamp(deaths_ - 1, 0, 16);
  const auto backoff = std::min(limits_.first_backoff * (1 << doublings), limits_.longest_backoff);
  retry_at_ns_ = now_ns + Ns(backoff);
  Enter(Phase::kBackoff, Supervision::State::kRestarting,
        "its worker failed: " + failure + "; starting it again", now_ns);
}

// Sources and processors may take seconds to make; the other links' watchdog can't wait for that.
void LinkSupervisor::BeginBuild(int64_t now_ns) {
  Enter(Phase::kBuilding, Supervision::State::kRestarting, "a fresh worker is being made", now_ns);
  build_ = std::make_shared<Build>();
  if (!factories_.source || !factories_.processor) {
    build_->result = Error{ErrorCode::kUnsupported, "it cannot be restarted in this mode"};
    build_->done = true;
    return;
  }
  const auto started = StartDetachedThread(
      "build:" + name_, [build = build_, factories = factories_] { build->Run(factories); });
  if (started) return;
  build_->result = started.error();
  build_->done = true;
}

void LinkSupervisor::AwaitBuild(int64_t now_ns) {
  if (!build_->done) {
    if (now_ns - phase_since_ns_ <= Ns(limits_.build)) return;
    build_ = std::make_shared<Build>();  // whatever the old one still makes goes with its thread
    build_->result = Error{ErrorCode::kTimeout, "making its source and processor takes too long"};
  }
  const auto build = std::exchange(build_, nullptr);
  if (!build->result) {
    started_ns_ = now_ns;
    return Died(build->result.error().message, now_ns);
  }
  cameras_->Tell(*build->source);
  auto worker = std::make_shared<LinkWorker>(name_, std::move(build->source), std::move(build->processor),
                                             outlet_, clock_, options_);
  started_ns_ = now_ns;
  counted_since_ns_ = {};
  worker->Start();
  {
    const std::lock_guard lock(mutex_);
    if (closed_) worker->CloseCommands(*closed_);
    worker_ = std::move(worker);
    ++supervision_.restarts;
  }
  const LogEvent event("worker_restarted");
  SPDLOG_INFO("link {}: a fresh worker runs", name_);
  Enter(Phase::kRunning, Supervision::State::kRunning, "", now_ns);
}

void LinkSupervisor::Enter(Phase phase, Supervision::State state, std::string reason, int64_t now_ns) {
  phase_ = phase;
  phase_since_ns_ = now_ns;
  const std::lock_guard lock(mutex_);
  news_ = news_ || supervision_.reason != reason;
  supervision_.state = state;
  supervision_.reason = std::move(reason);
}

void LinkSupervisor::Report(int64_t now_ns) {
  const Supervision now = supervision();
  const bool trouble = now.state != Supervision::State::kRunning;
  outlet_->SetTrouble(trouble);
  if (!trouble) {
    news_ = false;
    return;
  }
  if (!news_ && now_ns - outlet_->last_published_ns() < Ns(limits_.heartbeat)) return;
  if (outlet_->PublishLost({ReasonId::kWorker, now.reason})) news_ = false;
}

Supervision LinkSupervisor::supervision() const {
  const std::lock_guard lock(mutex_);
  return supervision_;
}

SourceCondition LinkSupervisor::source_condition() const {
  const std::lock_guard lock(mutex_);
  if (!worker_) return past_;
  SourceCondition condition = worker_->source_condition();
  condition.restarts += past_.restarts;
  return condition;
}

std::shared_ptr<LinkWorker> LinkSupervisor::current() const {
  const std::lock_guard lock(mutex_);
  return worker_;
}

Result<void> LinkSupervisor::Calibrate(const CalibrationOrder& order, CalibrationObserver observer) {
  if (const auto worker = current()) return worker->Calibrate(order, std::move(observer));
  return NoWorker();
}

Result<void> LinkSupervisor::Tare(const TareOptions& options, TareObserver observer) {
  if (const auto worker = current()) return worker->Tare(options, std::move(observer));
  return NoWorker();
}

Result<void> LinkSupervisor::SetCamera(const CameraOrder& order, CommandObserver observer) {
  const auto kept = [memory = cameras_, order, observer = std::move(observer)](const Result<void>& done) {
    if (done) memory->Keep(order);
    observer(done);
  };
  if (const auto worker = current()) return worker->SetCamera(order, kept);
  return NoWorker();
}

void LinkSupervisor::CloseCommands(const Error& why) {
  {
    const std::lock_guard lock(mutex_);
    closed_ = why;
  }
  if (const auto worker = current()) worker->CloseCommands(why);
}

Result<void> LinkSupervisor::SetForceModel(std::optional<ForceModel> model, CommandObserver observer) {
  if (!factories_.estimator)
    return Error{ErrorCode::kFailedPrecondition, "link '" + name_ + "' computes no forces here"};
  const auto worker = current();
  if (!worker) return NoWorker();
  const auto adopted = [choose = factories_.choose, model,
                        observer = std::move(observer)](const Result<void>& done) {
    if (done && choose) choose(model);
    observer(done);
  };
  try {
    auto estimator = factories_.estimator(model);
    if (!estimator)
      return Error{estimator.error().code, "link '" + name_ + "': " + estimator.error().message};
    return worker->UseEstimator(std::move(*estimator), adopted);
  } catch (const std::exception& e) {
    return Error{ErrorCode::kInternal, std::string("the force model can't be made: ") + DescribeLimit(e)};
  }
}

Error LinkSupervisor::NoWorker() const {
  return {ErrorCode::kUnavailable, "link '" + name_ + "' has no worker now: " + supervision().reason};
}

}  // namespace taclink::server

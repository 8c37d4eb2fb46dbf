#include "server/link/link_worker.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "sensing/core/thread_start.h"
#include "server/process/system_limits.h"

namespace taclink::server {
namespace {

const Error kGivenUp{ErrorCode::kUnavailable, "the link's worker hangs and was given up"};

}  // namespace

LinkWorker::LinkWorker(std::string name, std::unique_ptr<FrameSource> source,
                       std::unique_ptr<LinkProcessor> processor, std::shared_ptr<LinkOutlet> outlet,
                       Clock& clock, LinkWorkerOptions options)
    : name_(std::move(name)),
      outlet_(std::move(outlet)),
      life_(outlet_->NewLife()),
      clock_(clock),
      options_(std::move(options)),
      supervisor_(name_, std::move(source), clock, options_.supervisor, &capture_mark_),
      processor_(std::move(processor)) {}

LinkWorker::~LinkWorker() {
  Stop();
}

void LinkWorker::Start() {
  capture_ = StartThread("cap", &LinkWorker::Capture);
  solve_ = StartThread("fem", &LinkWorker::Solve);
}

std::jthread LinkWorker::StartThread(const char* kind, void (LinkWorker::*loop)(const std::stop_token&)) {
  const int64_t now_ns = clock_.MonotonicNs();
  (kind == std::string_view("cap") ? capture_mark_ : fem_mark_).Begin(WorkStage::kWait, now_ns);
  {
    const std::lock_guard lock(end_mutex_);
    ++running_;
  }
  auto thread = taclink::StartThread(
      std::string(kind) + ":" + name_,
      [this, loop, self = weak_from_this().lock()](const std::stop_token& stop) { RunThread(loop, stop); });
  if (thread) return *std::move(thread);
  Died(thread.error().message);
  const std::lock_guard lock(end_mutex_);
  --running_;
  return {};
}

// The root of both threads: what leaves a loop ends here and is the watchdog's to deal with.
void LinkWorker::RunThread(void (LinkWorker::*loop)(const std::stop_token&), const std::stop_token& stop) {
  SetUpThread(options_.realtime);
  try {
    (this->*loop)(stop);
  } catch (const std::exception& e) {
    Died(DescribeLimit(e));
  } catch (...) {
    Died("an exception of unknown type");
  }
  // Closing a camera and waiting for a tangent may take long. Each thread does it for its own part and counts
  // as running meanwhile: the watchdog, which joins it, does not wait.
  if (loop == &LinkWorker::Capture) {
    supervisor_.Close();
  } else {
    processor_.reset();
  }
  const std::lock_guard lock(end_mutex_);
  --running_;
  ended_.notify_all();
}

void LinkWorker::Died(const std::string& reason) {
  const Error error{ErrorCode::kInternal, "the link's worker failed: " + reason};
  EndCalibrationFromOutside(error);
  tare_.EndFromOutside(error);
  CloseCommands(error);
  const std::lock_guard lock(end_mutex_);
  if (!failure_) failure_ = reason;
}

std::optional<std::string> LinkWorker::failure() const {
  const std::lock_guard lock(end_mutex_);
  return failure_;
}

int LinkWorker::WaitEnded(std::chrono::milliseconds limit) {
  std::unique_lock lock(end_mutex_);
  ended_.wait_for(lock, limit, [this] { return running_ == 0; });
  return running_;
}

void LinkWorker::Abandon() {
  RequestStop();
  if (outlet_->IsCurrent(life_)) outlet_->NewLife();  // nobody's, until the next worker is there
  EndCalibrationFromOutside(kGivenUp);
  tare_.EndFromOutside(kGivenUp);
  CloseCommands(kGivenUp);
  if (capture_.joinable()) capture_.detach();
  if (solve_.joinable()) solve_.detach();
}

void LinkWorker::RequestStop() {
  capture_.request_stop();
  solve_.request_stop();
}

void LinkWorker::Stop() {
  RequestStop();
  if (capture_.joinable()) capture_.join();
  if (solve_.joinable()) solve_.join();
}

void LinkWorker::Capture(const std::stop_token& stop) {
  StereoFrame frame;
  while (!stop.stop_requested()) {
    capture_mark_.Begin(WorkStage::kWait, clock_.MonotonicNs());
    capture_commands_.RunAll(supervisor_);
    if (supervisor_.WaitsForReader() && !mailbox_.WaitUntilTaken(options_.poll)) continue;
    if (!supervisor_.Next(frame, options_.poll)) continue;
    if (options_.pressure) options_.pressure->Apply(frame);
    if (options_.attitude) options_.attitude->Apply(frame);
    frame.pressure.mpa = ExactInPascals(frame.pressure.mpa);
    if (frame.pressure_mpa) frame.pressure_mpa = ExactInPascals(*frame.pressure_mpa);
    mailbox_.Put(frame);
  }
  capture_commands_.Close({ErrorCode::kUnavailable, "the link is stopping"});
}

void LinkWorker::Solve(const std::stop_token& stop) {
  StereoFrame frame;
  while (!stop.stop_requested()) {
    fem_mark_.Begin(WorkStage::kWait, clock_.MonotonicNs());
    const bool any = mailbox_.Take(frame, options_.poll);
    TakeCalibrationOrder();
    fem_commands_.RunAll(*processor_);
    tare_.Begin(*processor_, clock_.MonotonicNs());
    if (any) {
      SolveOne(frame);
      TellCalibration();
    } else {
      PublishStatusIfDue();
    }
    EndCalibrationIfStuck();
    tare_.Poll(*processor_, clock_.MonotonicNs(),
               std::chrono::nanoseconds(options_.calibration_patience).count());
  }
  TakeCalibrationOrder();
  if (job_) EndCalibrationWithout({ErrorCode::kUnavailable, "the link is stopping"});
  tare_.End(*processor_, {ErrorCode::kUnavailable, "the link is stopping"});
  // Nobody would answer what is ordered from now on.
  EndCalibrationFromOutside({ErrorCode::kUnavailable, "the link is stopping"});
  fem_commands_.Close({ErrorCode::kUnavailable, "the link is stopping"});
  tare_.EndFromOutside({ErrorCode::kUnavailable, "the link is stopping"});
}

Result<void> LinkWorker::Calibrate(const CalibrationOrder& order, CalibrationObserver observer) {
  const std::lock_guard lock(calibration_mutex_);
  if (calibration_closed_)
    return Error{ErrorCode::kUnavailable,
                 "the worker of link '" + name_ + "' has ended; try again when it runs"};
  if (calibrating_)
    return Error{ErrorCode::kFailedPrecondition, "a calibration of link '" + name_ + "' is under way"};
  calibrating_ = true;
  watching_ = std::move(observer);
  ordered_ = order;
  return {};
}

Result<void> LinkWorker::SetCamera(const CameraOrder& order, CommandObserver done) {
  return capture_commands_.Post(
      [this, order](SourceSupervisor& source) {
        Result<void> set;
        for (const CameraId id : kBothCameras) {
          if (!set || !order.cameras[Index(id)]) continue;
          // The first camera may have hung: the second one may be another worker's by now.
          set = IsCurrent() ? source.SetCamera(id, order.settings) : Result<void>(kGivenUp);
        }
        return set;
      },
      std::move(done));
}

Result<void> LinkWorker::UseEstimator(std::shared_ptr<StateEstimator> estimator, CommandObserver done) {
  return fem_commands_.Post([estimator = std::move(estimator)](
                                LinkProcessor& processor) { return processor.UseEstimator(estimator); },
                            std::move(done));
}

void LinkWorker::CloseCommands(const Error& why) {
  capture_commands_.Close(why);
  fem_commands_.Close(why);
}

void LinkWorker::TakeCalibrationOrder() {
  {
    const std::lock_guard lock(calibration_mutex_);
    if (!ordered_) return;
    job_ = {.order = *std::exchange(ordered_, std::nullopt),
            .most_taken = 0,
            .progress_ns = clock_.MonotonicNs(),
            .waiting_for = {}};
  }
  job_->order.may_save = [this] { return MayEndCalibration(); };
  const auto begun = processor_->BeginCalibration(job_->order);
  if (!begun) EndCalibrationWithout(begun.error());
}

void LinkWorker::TellCalibration() {
  if (!job_) return;
  // Nobody is told any more what becomes of it: it must not become anything.
  if (!MayEndCalibration()) return EndCalibrationWithout({ErrorCode::kUnavailable, "ended from outside"});
  const CalibrationProgress progress = processor_->PollCalibration();
  job_->waiting_for = progress.waiting_for;
  if (progress.taken > job_->most_taken) {
    job_->most_taken = progress.taken;
    job_->progress_ns = clock_.MonotonicNs();
  }
  if (progress.end) {
    SPDLOG_INFO("link {}: calibration: {}", name_, *progress.end ? "done" : progress.end->error().message);
    if (const auto observer = ForgetCalibration()) observer(progress);
  } else if (const auto observer = Watching(); observer && !observer(progress)) {
    processor_->CancelCalibration();
    SPDLOG_INFO("link {}: calibration: cancelled", name_);
    ForgetCalibration();
  }
}

// Frames that cannot be rest pairs are no progress.
void LinkWorker::EndCalibrationIfStuck() {
  const int64_t patience_ns = std::chrono::nanoseconds(options_.calibration_patience).count();
  if (!job_ || clock_.MonotonicNs() - job_->progress_ns <= patience_ns) return;
  const std::string why = job_->waiting_for.empty() ? "no images arrive from the link's cameras"
                                                    : "no further rest pair: " + job_->waiting_for;
  EndCalibrationWithout({ErrorCode::kUnavailable, why});
}

CalibrationObserver LinkWorker::Watching() {
  const std::lock_guard lock(calibration_mutex_);
  return watching_;
}

// Who is to be told of the end; none: it was told from outside.
CalibrationObserver LinkWorker::ForgetCalibration() {
  job_.reset();
  const std::lock_guard lock(calibration_mutex_);
  calibrating_ = false;
  return std::exchange(watching_, nullptr);
}

void LinkWorker::EndCalibrationWithout(const Error& error) {
  processor_->CancelCalibration();
  SPDLOG_INFO("link {}: calibration: {}", name_, error.message);
  if (const auto observer = ForgetCalibration()) observer({.end = error});
}

void LinkWorker::EndCalibrationFromOutside(const Error& error) {
  CalibrationObserver observer;
  {
    const std::lock_guard lock(calibration_mutex_);
    calibration_closed_ = true;
    observer = std::exchange(watching_, nullptr);
    ordered_.reset();
  }
  if (observer) observer({.end = error});
}

void LinkWorker::SolveOne(StereoFrame& frame) {
  auto state = outlet_->Acquire();
  fem_mark_.Begin(settled_ && !job_ ? WorkStage::kFrame : WorkStage::kFirstFrames, clock_.MonotonicNs());
  try {
    processor_->Process(frame, *state);
    failing_ = 0;
    settled_ = state->status == LinkStatus::kOk || state->status == LinkStatus::kDegraded;
  } catch (const std::exception& e) {
    const std::string why = DescribeLimit(e);
    if (failing_ == 0)
      SPDLOG_ERROR("link {}: frame {} could not be processed: {}", name_, frame.sequence, why);
    if (++failing_ >= options_.failures)
      throw std::runtime_error(std::to_string(failing_) + " frames in a row failed: " + why);
    ResetTo(*state, LinkStatus::kLost, "processing failed: " + why, ReasonId::kWorker);
    state->times = frame.times;
  }
  state->sequence = frame.sequence;
  fem_mark_.Begin(WorkStage::kPublish, clock_.MonotonicNs());
  const LabelledMarkers* const labels = state->measured() ? processor_->labels() : nullptr;
  outlet_->PublishFrame(life_, std::move(state), frame, labels);
}

void LinkWorker::PublishStatusIfDue() {
  if (outlet_->trouble()) return;
  const SourceCondition condition = supervisor_.condition();
  const bool running = condition.state == SourceCondition::State::kRunning;
  const bool news = !running && condition.changes != reported_changes_;
  const int64_t last_published_ns = outlet_->last_published_ns();
  const int64_t silence_ns = clock_.MonotonicNs() - last_published_ns;
  // A slow source is not lost between its frames.
  const double rate_hz = running ? condition.info.frame_rate_hz : 0;
  const int64_t three_frames = rate_hz > 0 ? static_cast<int64_t>(3e9 / rate_hz) : 0;
  const int64_t patience_ns =
      std::max<int64_t>(std::chrono::nanoseconds(options_.heartbeat).count(), three_frames);
  const bool due = last_published_ns == 0 || silence_ns >= patience_ns;
  if (!news && !due) return;
  reported_changes_ = condition.changes;

  auto state = outlet_->Acquire();
  if (condition.state == SourceCondition::State::kStarting) {
    ResetTo(*state, LinkStatus::kStarting, "waiting for the first frame");
  } else {
    ResetTo(*state, LinkStatus::kLost, running ? "no new frame; waiting" : condition.reason,
            ReasonId::kNoFrames);
  }
  outlet_->PublishReport(life_, std::move(state));
}

}  // namespace taclink::server

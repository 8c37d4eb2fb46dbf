#include "server/link_worker.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>

namespace taclink::server {
namespace {

// A state that says nothing but `status`; its buffers stay.
void ResetTo(LinkState& state, LinkStatus status, std::string reason) {
  state.times = {};
  state.status = status;
  state.status_reason = std::move(reason);
  state.pressure_mpa.reset();
  state.cameras = {};
  state.tracking = {};
  state.shape.positions_mm.clear();
  state.shape.displacements_mm.clear();
  state.shape.covariances_mm2.clear();
  state.shape.sources.clear();
  state.shape.measured.clear();
  state.shape.rejected.clear();
  state.forces.forces_n.clear();
  state.forces.sigmas_n.clear();
  state.forces.residual = 0;
  state.forces.converged = true;
  state.contacts.clear();
  state.total_force_n = Vec3::Zero();
  state.baseline_age_s = 0;
  state.stage_ms = {};
}

}  // namespace

LinkWorker::LinkWorker(size_t link, std::string name, std::unique_ptr<FrameSource> source,
                       std::unique_ptr<LinkProcessor> processor, Hub& hub, Clock& clock,
                       LinkWorkerOptions options)
    : link_(link),
      name_(std::move(name)),
      hub_(hub),
      clock_(clock),
      options_(options),
      supervisor_(name_, std::move(source), clock, options.supervisor),
      processor_(std::move(processor)) {}

LinkWorker::~LinkWorker() {
  Stop();
}

void LinkWorker::Start() {
  capture_ = std::jthread([this](const std::stop_token& stop) { Capture(stop); });
  solve_ = std::jthread([this](const std::stop_token& stop) { Solve(stop); });
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
    if (supervisor_.Next(frame, options_.poll)) mailbox_.Put(frame);
  }
}

void LinkWorker::Solve(const std::stop_token& stop) {
  StereoFrame frame;
  while (!stop.stop_requested()) {
    const bool any = mailbox_.Take(frame, options_.poll);
    TakeCalibrationOrder();
    if (any) {
      SolveOne(frame);
      TellCalibration();
    } else {
      PublishStatusIfDue();
      if (job_ && clock_.MonotonicNs() - job_frame_ns_ >
                      std::chrono::nanoseconds(options_.calibration_patience).count())
        EndCalibrationWithout({ErrorCode::kUnavailable, "no pictures come from the link's cameras"});
    }
  }
  TakeCalibrationOrder();
  if (job_) EndCalibrationWithout({ErrorCode::kUnavailable, "server is shutting down"});
}

Result<void> LinkWorker::Calibrate(const CalibrationOrder& order, CalibrationObserver observer) {
  const std::lock_guard lock(calibration_mutex_);
  if (calibrating_)
    return Error{ErrorCode::kFailedPrecondition, "a calibration of link '" + name_ + "' is under way"};
  calibrating_ = true;
  ordered_ = CalibrationJob{order, std::move(observer)};
  return {};
}

void LinkWorker::TakeCalibrationOrder() {
  {
    const std::lock_guard lock(calibration_mutex_);
    if (!ordered_) return;
    job_ = std::exchange(ordered_, std::nullopt);
  }
  job_frame_ns_ = clock_.MonotonicNs();
  const auto begun = processor_->BeginCalibration(job_->order);
  if (!begun) EndCalibrationWithout(begun.error());
}

void LinkWorker::TellCalibration() {
  if (!job_) return;
  job_frame_ns_ = clock_.MonotonicNs();
  const CalibrationProgress progress = processor_->PollCalibration();
  const bool go_on = job_->observer(progress);
  if (go_on && !progress.end) return;
  if (!progress.end) processor_->CancelCalibration();
  spdlog::info("link {}: calibration: {}", name_,
               !progress.end   ? "cancelled"
               : *progress.end ? "done"
                               : progress.end->error().message);
  job_.reset();
  const std::lock_guard lock(calibration_mutex_);
  calibrating_ = false;
}

void LinkWorker::EndCalibrationWithout(const Error& error) {
  processor_->CancelCalibration();
  job_->observer({.end = error});
  spdlog::info("link {}: calibration: {}", name_, error.message);
  job_.reset();
  const std::lock_guard lock(calibration_mutex_);
  calibrating_ = false;
}

void LinkWorker::SolveOne(const StereoFrame& frame) {
  auto state = pool_.Acquire();
  try {
    processor_->Process(frame, *state);
    failing_ = false;
  } catch (const std::exception& e) {
    if (!failing_)
      spdlog::error("link {}: frame {} could not be processed: {}", name_, frame.sequence, e.what());
    failing_ = true;
    ResetTo(*state, LinkStatus::kLost, std::string("processing failed: ") + e.what());
    state->times = frame.times;
  }
  state->sequence = frame.sequence;
  last_sequence_ = frame.sequence;
  Stamp(*state);
  statistics_.Record(frame.sequence, frame.times.exposure_monotonic_ns, last_published_ns_);
  hub_.Publish(link_, pool_.Share(std::move(state)));
}

void LinkWorker::PublishStatusIfDue() {
  const SourceCondition condition = supervisor_.condition();
  const bool running = condition.state == SourceCondition::State::kRunning;
  const bool news = !running && condition.changes != reported_changes_;
  const int64_t silence_ns = clock_.MonotonicNs() - last_published_ns_;
  // A slow source is not lost between its frames.
  const double rate_hz = running ? condition.info.frame_rate_hz : 0;
  const int64_t three_frames = rate_hz > 0 ? static_cast<int64_t>(3e9 / rate_hz) : 0;
  const int64_t patience_ns =
      std::max<int64_t>(std::chrono::nanoseconds(options_.heartbeat).count(), three_frames);
  const bool due = last_published_ns_ == 0 || silence_ns >= patience_ns;
  if (!news && !due) return;
  reported_changes_ = condition.changes;

  auto state = pool_.Acquire();
  if (condition.state == SourceCondition::State::kStarting) {
    ResetTo(*state, LinkStatus::kStarting, "waiting for the first frame");
  } else {
    ResetTo(*state, LinkStatus::kLost, running ? "no new frame; waiting" : condition.reason);
  }
  state->sequence = last_sequence_;
  Stamp(*state);
  hub_.Publish(link_, pool_.Share(std::move(state)));
}

void LinkWorker::Stamp(LinkState& state) {
  last_published_ns_ = clock_.MonotonicNs();
  state.times.published_ns = last_published_ns_;
}

}  // namespace taclink::server

#include "server/events/event_engine.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <exception>
#include <random>
#include <utility>

#include "sensing/core/printable.h"
#include "sensing/core/thread_start.h"
#include "server/process/system_limits.h"

namespace taclink::server {
namespace {

constexpr size_t kQueue = 256;  // frames
constexpr size_t kMostPosts = 1024;
constexpr size_t kLongestText = 256;  // of what clients may have sent: the history must not grow by it
constexpr size_t kLongestAudit = 4096;
constexpr int64_t kBeatNs = 1'000'000'000;
constexpr std::chrono::milliseconds kPoll{100};  // how soon a beat that is due is noticed

std::string NewRunId(const Clock& clock) {
  std::random_device random;
  char text[40];
  std::snprintf(text, sizeof text, "%016llx%08x", static_cast<unsigned long long>(clock.UtcNs()), random());
  return text;
}

}  // namespace

const char* Name(EventKind kind) {
  static constexpr std::array<const char*, kEventKinds> kNames = {
      "contact_begin", "contact_update", "contact_end",   "force_level",   "link_status", "tare",
      "calibration",   "baseline",       "drift",         "thresholds",    "frames_lost", "recording",
      "force_model",   "camera",         "clock_stepped", "pressure_trip", "acceptance"};
  return kNames[static_cast<size_t>(kind)];
}

/// Outlives the engine where a publisher is still about to set it.
struct EventEngine::Signal {
  void Set() {
    {
      const std::lock_guard lock(mutex);
      set = true;
    }
    changed.notify_one();
  }
  void Wait(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, timeout, [this] { return set; });
    set = false;
  }
  std::mutex mutex;
  std::condition_variable changed;
  bool set = false;
};

EventEngine::EventEngine(Hub& hub, std::vector<WatchedLink> links, const EventOptions& options, Clock& clock)
    : hub_(hub),
      clock_(clock),
      links_(std::move(links)),
      options_(options),
      signal_(std::make_shared<Signal>()),
      history_(static_cast<size_t>(options.history), NewRunId(clock)),
      audit_(options.audit, static_cast<size_t>(options.audit_max_kb) * 1024),
      lost_told_(links_.size(), 0) {
  for (size_t i = 0; i < links_.size(); ++i)
    watches_.emplace_back(i, links_[i].rules, links_[i].grid, options, links_[i].length_unit);
  clock_watch_.Poll(clock_);  // steps count from here
}

EventEngine::~EventEngine() {
  Stop();
}

void EventEngine::Subscribe() {
  subscription_ = hub_.Subscribe({.delivery = Delivery::kEvery, .queue_capacity = kQueue},
                                 [signal = signal_] { signal->Set(); });
}

void EventEngine::Start() {
  if (!subscription_) Subscribe();
  thread_ = MustStartThread("events", [this](const std::stop_token& stop) { Run(stop); });
}

void EventEngine::Stop() {
  thread_.request_stop();
  signal_->Set();
  if (thread_.joinable()) thread_.join();
}

void EventEngine::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    signal_->Wait(kPoll);
    Drain();
  }
  Drain();
}

void EventEngine::Drain() {
  try {
    TakePosts();
    TakeFrames();
    TellLostFrames();
  } catch (const std::exception& e) {
    SPDLOG_ERROR("events: {}", DescribeLimit(e));
  }
  if (clock_.MonotonicNs() - beat_ns_ < kBeatNs) return;
  beat_ns_ = clock_.MonotonicNs();
  TellClockStep();
  history_.Beat();
}

void EventEngine::TellClockStep() {
  const auto step_ns = clock_watch_.Poll(clock_);
  if (!step_ns) return;
  const double step_s = static_cast<double>(*step_ns) / 1e9;
  std::string outcome = fmt::format(
      "UTC stepped by {:+.3f} s against the monotonic clock: the clock was set, or the machine was "
      "suspended; "
      "UTC times from before and after do not fit together",
      step_s);
  SPDLOG_WARN("clock: {}", outcome);
  Event event;
  event.kind = EventKind::kClockStepped;
  event.detail = Operation{.who = "server", .outcome = std::move(outcome), .values = {{"step_s", step_s}}};
  Raise(std::move(event));
}

void EventEngine::TakePosts() {
  std::vector<Posted> posts;
  {
    const std::lock_guard lock(mutex_);
    std::swap(posts, posts_);
  }
  for (Posted& post : posts) {
    if (!post.kind) {
      audit_.Write(post.what, post.operation, clock_.UtcNs());
      continue;
    }
    Event event;
    event.kind = *post.kind;
    event.link = post.link;
    event.detail = std::move(post.operation);
    Raise(std::move(event));
  }
}

void EventEngine::TakeFrames() {
  while (const auto publication = subscription_->Take()) {
    events_.clear();
    {
      const std::lock_guard lock(mutex_);
      watches_[publication->link()].Take(publication->state(), events_);
    }
    for (Event& event : events_) Raise(std::move(event));
  }
}

void EventEngine::TellLostFrames() {
  if (subscription_->dropped() == all_lost_told_) return;
  all_lost_told_ = subscription_->dropped();
  const auto counts = subscription_->Counts();
  for (size_t link = 0; link < counts.size(); ++link) {
    const uint64_t lost = counts[link].dropped - std::exchange(lost_told_[link], counts[link].dropped);
    if (lost == 0) continue;
    Event event;
    event.kind = EventKind::kFramesLost;
    event.link = link;
    event.detail = FramesLostDetail{lost};
    Raise(std::move(event));
  }
}

void EventEngine::Raise(Event event) {
  event.raised_ns = clock_.MonotonicNs();
  event.raised_utc_ns = clock_.UtcNs();
  audit_.Write(event, event.link ? links_[*event.link].name : std::string());
  history_.Add(std::move(event));
}

void EventEngine::Post(EventKind kind, std::optional<size_t> link, Operation operation) {
  operation.who.resize(Cut(operation.who, kLongestText).kept.size());
  operation.outcome.resize(Cut(operation.outcome, kLongestText).kept.size());
  Take({kind, Name(kind), link, std::move(operation)});
}

void EventEngine::Audit(const std::string& what, Operation operation) {
  operation.outcome.resize(Cut(operation.outcome, kLongestAudit).kept.size());
  Take({std::nullopt, what, std::nullopt, std::move(operation)});
}

void EventEngine::Take(Posted posted) {
  {
    const std::lock_guard lock(mutex_);
    if (posts_.size() >= kMostPosts) {
      SPDLOG_ERROR("events: too many at once; one of kind {} is lost", posted.what);
      return;
    }
    posts_.push_back(std::move(posted));
  }
  signal_->Set();
}

Result<void> EventEngine::SetThresholds(size_t link, const std::string& region, const Thresholds& thresholds,
                                        const std::string& who) {
  Operation operation{.who = who,
                      .outcome = {},
                      .values = {{"warning_n", thresholds.warning_n},
                                 {"alarm_n", thresholds.alarm_n},
                                 {"hysteresis_n", thresholds.hysteresis_n}}};
  auto good = CheckThresholds(thresholds);
  if (good) {
    const std::lock_guard lock(mutex_);
    ForceWatch* const force = watches_[link].Find(region);
    if (force != nullptr) {
      operation.values["old_warning_n"] = force->thresholds().warning_n;
      operation.values["old_alarm_n"] = force->thresholds().alarm_n;
      operation.values["old_hysteresis_n"] = force->thresholds().hysteresis_n;
      force->SetThresholds(thresholds);
    } else {
      std::string known;
      for (const auto& one : watches_[link].forces())
        known += one.name().empty() ? "" : (known.empty() ? "" : ", ") + one.name();
      good = Error{ErrorCode::kNotFound, "link '" + links_[link].name + "' has no region '" + region + "'" +
                                             (known.empty() ? "" : "; it has " + known)};
    }
  }
  operation.accepted = good.ok();
  operation.outcome = (region.empty() ? "whole link" : "region " + region) +
                      (good ? std::string() : ": " + good.error().message);
  Post(EventKind::kThresholds, link, std::move(operation));
  return good;
}

std::vector<LevelReport> EventEngine::Levels(size_t link) const {
  const std::lock_guard lock(mutex_);
  std::vector<LevelReport> reports;
  for (const ForceWatch& force : watches_[link].forces())
    reports.push_back({force.name(), force.thresholds(), force.level(), force.force_n()});
  return reports;
}

}  // namespace taclink::server

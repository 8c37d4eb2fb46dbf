#include "server/acceptance/trial_measurement.h"

#include <boost/asio/post.hpp>
#include <string>
#include <utility>

namespace taclink::server {
namespace {

constexpr std::chrono::milliseconds kTick{250};
constexpr size_t kQueue = 64;

}  // namespace

std::shared_ptr<TrialMeasurement> TrialMeasurement::Start(Hub& hub, Clock& clock,
                                                          boost::asio::thread_pool& pool,
                                                          const MeasurementOptions& options,
                                                          IsCancelled is_cancelled, Done done) {
  std::shared_ptr<TrialMeasurement> measurement(
      new TrialMeasurement(clock, pool, options, std::move(is_cancelled), std::move(done)));
  boost::asio::post(measurement->strand_, [measurement, &hub] { measurement->Begin(hub); });
  return measurement;
}

TrialMeasurement::TrialMeasurement(Clock& clock, boost::asio::thread_pool& pool,
                                   const MeasurementOptions& options, IsCancelled is_cancelled, Done done)
    : options_(options),
      clock_(clock),
      start_ns_(clock.MonotonicNs()),
      is_cancelled_(std::move(is_cancelled)),
      strand_(boost::asio::make_strand(pool.get_executor())),
      timer_(strand_),
      collector_(options.place_mm, options.near_mm, options.keeps_held),
      done_(std::move(done)),
      last_frame_ns_(start_ns_) {}

void TrialMeasurement::Begin(Hub& hub) {
  SubscriberOptions wanted{.delivery = Delivery::kEvery, .queue_capacity = kQueue};
  wanted.links.assign(hub.links(), false);
  wanted.links[options_.link] = true;
  // Weak, since the hub may still call this while the subscription is destroyed.
  subscription_ = hub.Subscribe(std::move(wanted), [weak = weak_from_this(), strand = strand_] {
    boost::asio::post(strand, [weak] {
      if (const auto measurement = weak.lock()) measurement->Drain();
    });
  });
  Drain();
  Tick();
}

void TrialMeasurement::Drain() {
  while (done_) {
    const PublicationPtr publication = subscription_->Take();
    if (!publication) return;
    const LinkState& state = publication->state();
    if (state.times.exposure_monotonic_ns < start_ns_) continue;
    last_frame_ns_ = clock_.MonotonicNs();
    collector_.Add(state);
    if (collector_.duration_s() >= options_.duration_s) Finish(collector_.Reading());
  }
}

void TrialMeasurement::Tick() {
  if (!done_) return;
  if (is_cancelled_ && is_cancelled_())
    return Finish(Error{ErrorCode::kEndOfData, "the caller has cancelled the measurement"});
  const auto silent_ns = clock_.MonotonicNs() - last_frame_ns_;
  if (silent_ns > std::chrono::nanoseconds(options_.silence).count()) {
    return Finish(Error{ErrorCode::kUnavailable,
                        "the link delivers no frames; the trial was not measured (see taclink list)"});
  }
  timer_.expires_after(kTick);
  timer_.async_wait([self = shared_from_this()](const boost::system::error_code&) { self->Tick(); });
}

void TrialMeasurement::End(const Error& why) {
  boost::asio::post(strand_, [self = shared_from_this(), why] {
    if (self->done_) self->Finish(why);
  });
}

void TrialMeasurement::Finish(const Result<TrialReading>& result) {
  subscription_.reset();
  timer_.cancel();
  std::exchange(done_, nullptr)(result);
}

}  // namespace taclink::server

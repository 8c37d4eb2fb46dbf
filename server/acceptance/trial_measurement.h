#pragma once

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>

#include "sensing/acceptance/reading_collector.h"
#include "sensing/core/clock.h"
#include "sensing/core/result.h"
#include "server/hub/hub.h"

namespace taclink::server {

/// The frames that a measurement averages.
struct MeasurementOptions {
  size_t link = 0;
  std::optional<Vec3> place_mm = {};  ///< of the load, link frame
  double near_mm = 30;                ///< contacts further away do not belong to the load
  bool keeps_held = false;
  double duration_s = 1;
  /// The link counts as silent after this time without a frame.
  std::chrono::milliseconds silence{5000};
};

/// Averages a link's next frames, as a subscriber of the hub. Frames exposed before the start are ignored:
/// they may show the skin without the load. Owned by its timer and its jobs on the pool, which must be joined
/// before the hub ends; `done` is called once, on the pool.
class TrialMeasurement : public std::enable_shared_from_this<TrialMeasurement> {
 public:
  using Done = std::function<void(const Result<TrialReading>&)>;
  /// Polled by the timer; true: the caller has cancelled.
  using IsCancelled = std::function<bool()>;

  static std::shared_ptr<TrialMeasurement> Start(Hub& hub, Clock& clock, boost::asio::thread_pool& pool,
                                                 const MeasurementOptions& options, IsCancelled is_cancelled,
                                                 Done done);

  /// Ends the measurement with this error. Any thread.
  void End(const Error& why);

 private:
  TrialMeasurement(Clock& clock, boost::asio::thread_pool& pool, const MeasurementOptions& options,
                   IsCancelled is_cancelled, Done done);
  void Begin(Hub& hub);
  void Drain();
  void Tick();
  void Finish(const Result<TrialReading>& result);

  // Constant after construction.
  const MeasurementOptions options_;
  Clock& clock_;
  const int64_t start_ns_;
  const IsCancelled is_cancelled_;

  // Used on the strand only.
  boost::asio::strand<boost::asio::thread_pool::executor_type> strand_;
  boost::asio::steady_timer timer_;
  std::unique_ptr<Subscription> subscription_;
  ReadingCollector collector_;
  Done done_;  // null: already called
  int64_t last_frame_ns_;
};

}  // namespace taclink::server

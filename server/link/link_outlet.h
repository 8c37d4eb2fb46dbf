#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "sensing/core/clock.h"
#include "sensing/core/link_state.h"
#include "server/hub/hub.h"
#include "server/hub/state_pool.h"
#include "server/link/force_history.h"
#include "server/link/link_histograms.h"
#include "server/link/link_statistics.h"

namespace taclink::server {

/// Clears all of `state` and sets its status and the reason; its buffers stay.
void ResetTo(LinkState& state, LinkStatus status, std::string reason, std::optional<ReasonId> id = {});

/// How old a frame may be when it is published, so that it still tells how the link is now.
struct AgeLimit {
  std::chrono::nanoseconds configured{0};  ///< 0: three frame periods of the source, and at least 0.2 s
  /// For frames of a source with this period; 0: not known.
  int64_t Ns(int64_t period_ns) const;
};

/// Where a link's states leave, and who may still act for the link: what a worker does outside its own memory
/// (files, cameras) goes by IsCurrent; what follows from its answers (events, memory of the cameras'
/// settings) ends with LinkWorker::Abandon, which answers in its place. It outlasts the workers that the link
/// has one after the other: only the newest may publish, so that one that was given up can do no harm when it
/// comes back. Also the hub may go before it.
class LinkOutlet {
 public:
  LinkOutlet(size_t link, Hub& hub, Clock& clock, std::optional<AgeLimit> age_limit = {})
      : link_(link), clock_(clock), age_limit_(age_limit), hub_(&hub) {}

  /// A new worker: from now on its states are taken and no other's.
  uint64_t NewLife() { return ++life_; }
  bool IsCurrent(uint64_t life) const { return life_ == life; }
  /// Nothing leaves any more; the hub is not touched afterwards.
  void Close();

  /// Stamps and publishes what worker `life` made of a frame, and counts it. A frame older than the limit is
  /// degraded. Where somebody wants the
  /// pictures too, those of `frame` are taken and old buffers left in their place, with a copy of `labels`
  /// (null: none). False: refused, for there is a newer worker.
  bool PublishFrame(uint64_t life, std::unique_ptr<LinkState> state, StereoFrame& frame,
                    const LabelledMarkers* labels = nullptr);
  /// The same for a mere report of the worker's, which bears the last frame's number.
  bool PublishReport(uint64_t life, std::unique_ptr<LinkState> state);
  /// In place of the worker. False: the worker is publishing at this moment.
  bool PublishLost(const Reason& reason);

  /// While somebody else reports the link's trouble its worker sends no mere reports.
  void SetTrouble(bool trouble) { trouble_ = trouble; }
  bool trouble() const { return trouble_; }

  int64_t last_published_ns() const { return last_published_ns_; }  ///< monotonic; 0: nothing yet
  std::unique_ptr<LinkState> Acquire() { return pool_.Acquire(); }
  LinkStatistics Statistics() const { return statistics_.Snapshot(clock_.MonotonicNs()); }
  const LinkHistograms& histograms() const { return histograms_; }
  const ForceHistory& forces() const { return forces_; }

 private:
  // With the lock held.
  PicturesPtr TakePictures(StereoFrame& frame, const LabelledMarkers* labels);
  void JudgeAge(LinkState& state, int64_t period_ns) const;
  void Send(std::unique_ptr<LinkState> state);
  void Send(std::unique_ptr<LinkState> state, const PicturesPtr& pictures);

  // Constant after construction.
  const size_t link_;
  Clock& clock_;
  const std::optional<AgeLimit> age_limit_;  // none: frames of any age are published as they are

  StatePool pool_;
  SharedPool<FramePictures> picture_pool_;
  LinkStatisticsCollector statistics_;
  LinkHistograms histograms_;
  ForceHistory forces_;
  std::atomic<uint64_t> life_ = 0;
  std::atomic<bool> trouble_ = false;
  std::atomic<int64_t> last_published_ns_ = 0;

  std::mutex mutex_;
  // Guarded by mutex_.
  Hub* hub_;  // null: closed
  uint64_t last_sequence_ = 0;
};

}  // namespace taclink::server

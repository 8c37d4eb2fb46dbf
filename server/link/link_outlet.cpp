#include "server/link/link_outlet.h"

#include <utility>

#include "sensing/core/link_state_fields.h"

namespace taclink::server {

void ResetTo(LinkState& state, LinkStatus status, std::string reason, std::optional<ReasonId> id) {
  ResetField(state, LinkState());
  if (id) state.reasons.push_back({*id, reason});
  state.status = status;
  state.status_reason = std::move(reason);
}

void LinkOutlet::Close() {
  ++life_;
  const std::lock_guard lock(mutex_);
  hub_ = nullptr;
}

bool LinkOutlet::PublishFrame(uint64_t life, std::unique_ptr<LinkState> state, StereoFrame& frame,
                              const LabelledMarkers* labels) {
  const std::lock_guard lock(mutex_);
  if (life != life_ || hub_ == nullptr) return false;
  // Before anyone can see it.
  state->times.published_ns = clock_.MonotonicNs();
  statistics_.RecordPictures(state->cameras);
  // How late a log's frames were then is nothing that this server does.
  const int64_t exposure_ns = state->replayed ? 0 : frame.times.exposure_monotonic_ns;
  statistics_.Record(state->sequence, exposure_ns, state->times.published_ns);
  histograms_.Record(*state);
  forces_.Add(*state);
  PicturesPtr pictures;
  if (hub_->WantsPictures(link_)) {
    auto taken = picture_pool_.Acquire();
    std::swap(taken->raw, frame.images);
    for (size_t i = 0; i < kCameraCount; ++i) {
      taken->labels.cameras[i].clear();
      if (labels != nullptr) taken->labels.cameras[i] = labels->cameras[i];
    }
    pictures = picture_pool_.Share(std::move(taken));
  }
  Send(std::move(state), pictures);
  return true;
}

bool LinkOutlet::PublishReport(uint64_t life, std::unique_ptr<LinkState> state) {
  const std::lock_guard lock(mutex_);
  if (life != life_ || hub_ == nullptr) return false;
  state->sequence = last_sequence_;
  Send(std::move(state));
  return true;
}

bool LinkOutlet::PublishLost(const Reason& reason) {
  const std::unique_lock lock(mutex_, std::try_to_lock);  // the watchdog must not hang with a worker
  if (!lock || hub_ == nullptr) return false;
  auto state = pool_.Acquire();
  ResetTo(*state, LinkStatus::kLost, reason.text, reason.id);
  state->sequence = last_sequence_;
  Send(std::move(state));
  return true;
}

void LinkOutlet::Send(std::unique_ptr<LinkState> state, const PicturesPtr& pictures) {
  last_sequence_ = state->sequence;
  last_published_ns_ = state->times.published_ns = clock_.MonotonicNs();
  hub_->Publish(link_, pool_.Share(std::move(state)), pictures);
}

}  // namespace taclink::server

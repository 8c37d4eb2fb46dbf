#include "server/link/link_outlet.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "sensing/core/link_state_fields.h"

namespace taclink::server {
namespace {

constexpr int64_t kLeastAgeLimitNs = 200'000'000;

}  // namespace

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

int64_t AgeLimit::Ns(int64_t period_ns) const {
  return configured.count() > 0 ? configured.count() : std::max(kLeastAgeLimitNs, 3 * period_ns);
}

bool LinkOutlet::PublishFrame(uint64_t life, std::unique_ptr<LinkState> state, StereoFrame& frame,
                              const LabelledMarkers* labels) {
  const std::lock_guard lock(mutex_);
  if (life != life_ || hub_ == nullptr) return false;
  const PicturesPtr pictures = hub_->WantsPictures(link_) ? TakePictures(frame, labels) : nullptr;
  // The time that the age is judged by is the one that everyone sees, read last.
  state->times.published_ns = clock_.MonotonicNs();
  JudgeAge(*state, frame.period_ns);
  statistics_.RecordPictures(state->cameras);
  // How late a log's frames were then is nothing that this server does.
  const int64_t exposure_ns = state->replayed ? 0 : frame.times.exposure_monotonic_ns;
  statistics_.Record(state->sequence, exposure_ns, state->times.published_ns);
  histograms_.Record(*state);
  forces_.Add(*state);
  Send(std::move(state), pictures);
  return true;
}

PicturesPtr LinkOutlet::TakePictures(StereoFrame& frame, const LabelledMarkers* labels) {
  auto taken = picture_pool_.Acquire();
  std::swap(taken->raw, frame.images);
  for (size_t i = 0; i < kCameraCount; ++i) {
    taken->labels.cameras[i].clear();
    if (labels != nullptr) taken->labels.cameras[i] = labels->cameras[i];
  }
  return picture_pool_.Share(std::move(taken));
}

void LinkOutlet::JudgeAge(LinkState& state, int64_t period_ns) const {
  const FrameTimes& times = state.times;
  if (!age_limit_ || state.replayed || times.exposure_monotonic_ns == 0) return;
  const int64_t limit_ns = age_limit_->Ns(period_ns);
  const int64_t age_ns = times.published_ns - times.exposure_monotonic_ns;
  if (age_ns <= limit_ns) return;
  const double age_s = static_cast<double>(age_ns) / 1e9, limit_s = static_cast<double>(limit_ns) / 1e9;
  Degrade(state,
          {ReasonId::kLateFrame,
           fmt::format("published {:.3f} s after its exposure, which is more than the {:.3f} s allowed: "
                       "the link may have been touched since; see the machine's load, lower the frame "
                       "rate or force_refinement, or raise limits.max_frame_age_s",
                       age_s, limit_s),
           age_s, limit_s});
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

void LinkOutlet::Send(std::unique_ptr<LinkState> state) {
  state->times.published_ns = clock_.MonotonicNs();
  Send(std::move(state), nullptr);
}

void LinkOutlet::Send(std::unique_ptr<LinkState> state, const PicturesPtr& pictures) {
  last_sequence_ = state->sequence;
  last_published_ns_ = state->times.published_ns;
  hub_->Publish(link_, pool_.Share(std::move(state)), pictures);
}

}  // namespace taclink::server

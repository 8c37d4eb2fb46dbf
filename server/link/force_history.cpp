#include "server/link/force_history.h"

#include <algorithm>
#include <cmath>

namespace taclink::server {
namespace {

void Write(const LinkState& state, double total_n, ForceSample& out) {
  out.exposure_utc_ns = state.times.exposure_utc_ns;
  out.total_n = total_n;
  out.contacts = 0;
  for (const Contact& contact : state.contacts) {
    if (out.contacts == ForceSample::kMostContacts) return;
    out.contacts_n[out.contacts++] = {contact.id, contact.magnitude_n()};
  }
}

}  // namespace

void ForceHistory::Add(const LinkState& state) {
  if (state.times.exposure_utc_ns == 0) return;
  const double total_n = state.total_magnitude_n();
  const int64_t bin = state.times.exposure_utc_ns / kBinNs;
  const std::lock_guard lock(mutex_);
  if (!ring_.empty() && bin == bin_) {
    ForceSample& newest = ring_[newest_];
    if (std::isnan(newest.total_n) || total_n > newest.total_n) Write(state, total_n, newest);
    return;
  }
  // A log that is replayed begins again, or the clock was set.
  if (!ring_.empty() && bin < bin_) {
    ring_.clear();
    next_ = 0;
  }
  bin_ = bin;
  if (ring_.size() < kBins) {
    newest_ = ring_.size();
    ring_.emplace_back();
  } else {
    newest_ = next_;
    next_ = (next_ + 1) % kBins;
  }
  Write(state, total_n, ring_[newest_]);
}

std::vector<ForceSample> ForceHistory::Since(int64_t utc_ns) const {
  std::vector<ForceSample> samples;
  samples.reserve(kBins);  // before the lock: who publishes a frame may wait for it
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < ring_.size(); ++i) {
    const ForceSample& sample = ring_[(next_ + i) % ring_.size()];
    if (sample.exposure_utc_ns >= utc_ns) samples.push_back(sample);
  }
  return samples;
}

int64_t ForceHistory::newest_utc_ns() const {
  const std::lock_guard lock(mutex_);
  return ring_.empty() ? 0 : ring_[newest_].exposure_utc_ns;
}

}  // namespace taclink::server

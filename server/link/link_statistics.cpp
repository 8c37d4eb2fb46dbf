#include "server/link/link_statistics.h"

#include <algorithm>
#include <cmath>

namespace taclink::server {
namespace {

constexpr size_t kFramesKept = 300;
constexpr int64_t kRateWindowNs = 2'000'000'000;

// `values` must not be empty; nearest rank.
double PercentileMs(std::vector<int64_t>& values, double fraction) {
  const auto rank = static_cast<size_t>(std::ceil(fraction * static_cast<double>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::max<size_t>(rank, 1) - 1);
  std::nth_element(values.begin(), at, values.end());
  return static_cast<double>(*at) * 1e-6;
}

}  // namespace

LinkStatisticsCollector::LinkStatisticsCollector() : ring_(kFramesKept) {}

void LinkStatisticsCollector::Record(uint64_t sequence, int64_t exposure_ns, int64_t published_ns) {
  const std::lock_guard lock(mutex_);
  if (frames_ > 0 && sequence > last_sequence_) frames_skipped_ += sequence - last_sequence_ - 1;
  last_sequence_ = sequence;
  Entry& entry = ring_[frames_ % ring_.size()];
  entry = {.published_ns = published_ns};
  if (exposure_ns != 0) entry.latency_ns = published_ns - exposure_ns;
  ++frames_;
}

void LinkStatisticsCollector::RecordPictures(const std::array<CameraCounts, kCameraCount>& cameras) {
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < kCameraCount; ++i) bad_pictures_[i] += cameras[i].bad_picture ? 1 : 0;
}

// From the first to the last frame within the window. A window with room for more frames than are kept is
// short.
double LinkStatisticsCollector::Rate(int64_t now_ns) const {
  const uint64_t kept = std::min<uint64_t>(frames_, ring_.size());
  uint64_t within = 0;
  int64_t newest = 0, oldest = 0;
  for (; within < kept; ++within) {
    const int64_t published = ring_[(frames_ - 1 - within) % ring_.size()].published_ns;
    if (published < now_ns - kRateWindowNs) break;
    if (within == 0) newest = published;
    oldest = published;
  }
  if (within < 2 || newest == oldest) return 0;
  return static_cast<double>(within - 1) * 1e9 / static_cast<double>(newest - oldest);
}

LinkStatistics LinkStatisticsCollector::Snapshot(int64_t now_ns) const {
  const std::lock_guard lock(mutex_);
  LinkStatistics out{.rate_hz = Rate(now_ns),
                     .frames = frames_,
                     .frames_skipped = frames_skipped_,
                     .bad_pictures = bad_pictures_};
  std::vector<int64_t> latencies;
  for (uint64_t i = 0; i < std::min<uint64_t>(frames_, ring_.size()); ++i) {
    if (ring_[i].latency_ns) latencies.push_back(*ring_[i].latency_ns);
  }
  if (!latencies.empty()) {
    out.latency_p50_ms = PercentileMs(latencies, 0.50);
    out.latency_p99_ms = PercentileMs(latencies, 0.99);
  }
  return out;
}

}  // namespace taclink::server

#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "sensing/core/link_state.h"

namespace taclink::server {

/// Measured over a link's last frames.
struct LinkStatistics {
  double rate_hz = 0;         ///< over the last 2 s; 0: no frames
  double latency_p50_ms = 0;  ///< exposure to published, last 300 frames; 0: none yet
  double latency_p99_ms = 0;
  uint64_t frames = 0;                                ///< solved since the start
  uint64_t frames_skipped = 0;                        ///< exposed but not solved, since the start
  std::array<uint64_t, kCameraCount> bad_pictures{};  ///< by camera: could not be decoded, since the start
};

class LinkStatisticsCollector {
 public:
  LinkStatisticsCollector();

  /// A frame was published. A sequence that does not rise means that the source began again; an exposure at
  /// 0, that there is no latency.
  void Record(uint64_t sequence, int64_t exposure_ns, int64_t published_ns);
  void RecordPictures(const std::array<CameraCounts, kCameraCount>& cameras);
  LinkStatistics Snapshot(int64_t now_ns) const;

 private:
  struct Entry {
    int64_t published_ns = 0;
    std::optional<int64_t> latency_ns = {};
  };

  double Rate(int64_t now_ns) const;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<Entry> ring_;  // frames_ % size is the next place
  uint64_t frames_ = 0;
  uint64_t frames_skipped_ = 0;
  std::array<uint64_t, kCameraCount> bad_pictures_{};
  uint64_t last_sequence_ = 0;
};

}  // namespace taclink::server

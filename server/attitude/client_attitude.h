#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

#include "server/attitude/attitude_source.h"

namespace taclink::server {

/// The specific force as clients tell it (an inertial measurement unit on the link): at an exposure the
/// straight line between the readings around it, or the nearest one.
class ClientAttitude final : public AttitudeSource {
 public:
  /// `stale_after`: farther from an exposure a reading says nothing of it.
  ClientAttitude(double sigma_mps2, std::chrono::milliseconds stale_after);

  void Apply(StereoFrame& frame) override;
  Result<bool> Tell(const Vec3& mps2, double sigma_mps2, int64_t time_ns) override;

 private:
  struct Reading {
    int64_t time_ns = 0;
    Vec3 mps2 = Vec3::Zero();
    double sigma_mps2 = 0;
  };
  std::pair<std::optional<Reading>, std::optional<Reading>> Around(int64_t time_ns) const;

  const double sigma_mps2_;
  const int64_t stale_ns_;

  mutable std::mutex mutex_;
  std::deque<Reading> readings_;  // guarded by mutex_; times rise
};

}  // namespace taclink::server

#include "server/attitude/client_attitude.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace taclink::server {
namespace {

constexpr size_t kMostReadings = 1024;  // a second of a fast sensor
constexpr double kMostMps2 = 100;

SpecificForceReading ToReading(const Vec3& mps2, double sigma_mps2) {
  return {.mps2 = mps2,
          .covariance = sigma_mps2 * sigma_mps2 * Mat3::Identity(),
          .origin = AttitudeOrigin::kClient};
}

}  // namespace

ClientAttitude::ClientAttitude(double sigma_mps2, std::chrono::milliseconds stale_after)
    : sigma_mps2_(sigma_mps2), stale_ns_(std::chrono::nanoseconds(stale_after).count()) {}

Result<bool> ClientAttitude::Tell(const Vec3& mps2, double sigma_mps2, int64_t time_ns) {
  if (!mps2.allFinite() || mps2.cwiseAbs().maxCoeff() > kMostMps2 ||
      !(sigma_mps2 >= 0 && sigma_mps2 <= kMostMps2))
    return Error{ErrorCode::kInvalidArgument,
                 "specific_force_mps2 must be finite and at most 100 m/s^2 in each component"};
  const std::lock_guard lock(mutex_);
  if (!readings_.empty() && readings_.back().time_ns >= time_ns) return false;
  readings_.push_back({time_ns, mps2, sigma_mps2 > 0 ? sigma_mps2 : sigma_mps2_});
  if (readings_.size() > kMostReadings) readings_.pop_front();
  return true;
}

// The newest until then, and the oldest after it.
std::pair<std::optional<ClientAttitude::Reading>, std::optional<ClientAttitude::Reading>>
ClientAttitude::Around(int64_t time_ns) const {
  const std::lock_guard lock(mutex_);
  const auto after =
      std::upper_bound(readings_.begin(), readings_.end(), time_ns,
                       [](int64_t time, const Reading& reading) { return time < reading.time_ns; });
  return {after == readings_.begin() ? std::nullopt : std::optional(*std::prev(after)),
          after == readings_.end() ? std::nullopt : std::optional(*after)};
}

void ClientAttitude::Apply(StereoFrame& frame) {
  const int64_t time_ns = frame.times.exposure_monotonic_ns;
  auto [before, after] = Around(time_ns);
  if (before && time_ns - before->time_ns > stale_ns_) before.reset();
  if (after && after->time_ns - time_ns > stale_ns_) after.reset();
  if (before && after) {
    const double share = static_cast<double>(time_ns - before->time_ns) /
                         static_cast<double>(after->time_ns - before->time_ns);
    frame.specific_force = ToReading(before->mps2 + share * (after->mps2 - before->mps2),
                                     std::max(before->sigma_mps2, after->sigma_mps2));
  } else if (before || after) {
    const Reading& nearest = before ? *before : *after;
    frame.specific_force = ToReading(nearest.mps2, nearest.sigma_mps2);
  } else {
    char text[160];
    std::snprintf(text, sizeof text,
                  "no client has told the link's attitude within %.2f s of the exposure (UpdateAttitude)",
                  1e-9 * static_cast<double>(stale_ns_));
    frame.specific_force = UnknownSpecificForce(AttitudeOrigin::kClient, text);
  }
}

}  // namespace taclink::server

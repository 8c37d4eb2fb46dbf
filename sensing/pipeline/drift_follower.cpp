#include "sensing/pipeline/drift_follower.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr double kLongestStepS = 1;  // frames were missing: nobody knows what happened meanwhile

}  // namespace

DriftFollower::DriftFollower(int markers, const DriftOptions& options)
    : options_(options), drift_mm_(static_cast<size_t>(markers), Vec3::Zero()) {}

void DriftFollower::Reset() {
  std::fill(drift_mm_.begin(), drift_mm_.end(), Vec3::Zero());
  largest_mm_ = 0;
  following_ = false;
  last_ns_.reset();
}

void DriftFollower::Update(int64_t time_ns, std::optional<double> load_n, std::span<const Vec3> off_mm) {
  if (!last_ns_) quiet_since_ns_ = time_ns;
  const double seconds = static_cast<double>(time_ns - last_ns_.value_or(time_ns)) * 1e-9;
  last_ns_ = time_ns;
  const bool unsure = !load_n || seconds < 0 || seconds > kLongestStepS;
  if (unsure || *load_n > (following_ ? options_.stop_n : options_.go_n)) {
    following_ = false;
    quiet_since_ns_ = time_ns;
    return;
  }
  following_ = following_ || static_cast<double>(time_ns - quiet_since_ns_) * 1e-9 >= options_.quiet_s;
  if (following_) Follow(seconds, off_mm);
}

void DriftFollower::Follow(double seconds, std::span<const Vec3> off_mm) {
  const double part = -std::expm1(-seconds / options_.time_constant_s);
  const double longest = options_.rate_limit_mm_s * seconds;
  largest_mm_ = 0;
  for (size_t i = 0; i < drift_mm_.size() && i < off_mm.size(); ++i) {
    Vec3 step = part * (off_mm[i] - drift_mm_[i]);
    const double length = step.norm();
    if (length > longest) step *= longest / length;
    if (step.allFinite()) drift_mm_[i] += step;
    largest_mm_ = std::max(largest_mm_, drift_mm_[i].norm());
  }
}

}  // namespace taclink

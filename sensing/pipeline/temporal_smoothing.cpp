#include "sensing/pipeline/temporal_smoothing.h"

#include <cmath>

namespace taclink {
namespace {

constexpr size_t kLeastCompared = 2;
constexpr double kIdentical = 0.99;  // correlation of images that are one, saved again

}  // namespace

void TemporalSmoothing::Take(const cv::Mat& gray, bool is_rest) {
  if (is_rest && !was_rest_) {
    taken_ = compared_ = 0;
    near_sum_ = far_sum_ = 0;
  }
  was_rest_ = is_rest;
  if (!is_rest) return;
  NoiseSample& newest = samples_[taken_ % samples_.size()];
  newest.Take(gray);
  ++taken_;
  if (taken_ <= kFar) return;
  const auto near = NoiseSample::Correlation(newest, samples_[(taken_ - 2) % samples_.size()]);
  const auto far = NoiseSample::Correlation(newest, samples_[(taken_ - 1 - kFar) % samples_.size()]);
  if (!near || !far) return;
  near_sum_ += *near;
  far_sum_ += *far;
  ++compared_;
}

std::optional<double> TemporalSmoothing::share() const {
  if (compared_ < kLeastCompared) return std::nullopt;
  const auto count = static_cast<double>(compared_);
  const double near = near_sum_ / count, far = far_sum_ / count;
  if (!(far < kIdentical)) return std::nullopt;
  // With a share f of noise that all images have in common, near = f + (1 - f) a and far = f + (1 - f) a^k:
  // this ratio does not depend on f, and rises with a.
  const double ratio = (near - far) / (1 - far);
  double share = 0, above = 1;
  while (above - share > 1e-3) {
    const double a = 0.5 * (share + above), far_at = std::pow(a, kFar);
    ((a - far_at) / (1 - far_at) < ratio ? share : above) = a;
  }
  if (share < kLeastShare) return std::nullopt;
  return share;
}

}  // namespace taclink

#include "sensing/pipeline/marker_mean.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/median.h"

namespace taclink {
namespace {

// The skin moved if more than this part of the markers scatter by more than this; noise is a fraction of it.
constexpr double kMovedFraction = 0.03, kMovedPx = 1;

}  // namespace

MarkerMean::MarkerMean(int markers) {
  for (size_t c = 0; c < kCameraCount; ++c) {
    mean_.cameras[c].resize(static_cast<size_t>(markers));
    squares_[c].resize(static_cast<size_t>(markers));
    counts_[c].resize(static_cast<size_t>(markers));
  }
}

void MarkerMean::Clear() {
  frames_ = 0;
  variances_px2_.clear();
  noise_px_ = 0;
  for (size_t c = 0; c < kCameraCount; ++c) {
    std::fill(mean_.cameras[c].begin(), mean_.cameras[c].end(), MarkerObservation{});
    std::fill(squares_[c].begin(), squares_[c].end(), 0.0);
    std::fill(counts_[c].begin(), counts_[c].end(), 0);
  }
}

void MarkerMean::Add(const LabelledMarkers& labels) {
  ++frames_;
  for (size_t c = 0; c < kCameraCount; ++c) {
    for (size_t m = 0; m < labels.cameras[c].size() && m < counts_[c].size(); ++m) {
      const MarkerObservation& one = labels.cameras[c][m];
      if (!one.seen) continue;
      mean_.cameras[c][m].center_px += one.center_px;
      mean_.cameras[c][m].covariance_px2 += one.covariance_px2;
      squares_[c][m] += one.center_px.squaredNorm();
      ++counts_[c][m];
    }
  }
}

void MarkerMean::Finish() {
  for (size_t c = 0; c < kCameraCount; ++c) {
    for (size_t m = 0; m < counts_[c].size(); ++m) {
      MarkerObservation& mean = mean_.cameras[c][m];
      const int n = counts_[c][m];
      mean.seen = 2 * n > frames_;
      if (!mean.seen) continue;
      mean.center_px /= n;
      mean.covariance_px2 /= n * n;
      if (n > 1)
        variances_px2_.push_back((squares_[c][m] - n * mean.center_px.squaredNorm()) / (2.0 * (n - 1)));
    }
  }
  std::vector<double> sorted = variances_px2_;
  noise_px_ = std::sqrt(std::max(0.0, Median(sorted)));
}

bool MarkerMean::moved() const {
  const auto count = std::count_if(variances_px2_.begin(), variances_px2_.end(),
                                   [](double variance) { return variance > kMovedPx * kMovedPx; });
  return static_cast<double>(count) > kMovedFraction * static_cast<double>(variances_px2_.size());
}

}  // namespace taclink

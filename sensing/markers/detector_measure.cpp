// MarkerDetector's second half: what a blob's centre is, and whether it is a marker.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sensing/markers/detector.h"

namespace taclink {
namespace {

constexpr int kSmallArea = 60;      // px^2
constexpr int kNeighbourhood = 48;  // px, cells over which typical contrast is looked up

}  // namespace

double MarkerDetector::BackgroundAt(double x, double y) const {
  const double gx = std::clamp(x / cell_ - 0.5, 0.0, std::max(0.0, grid_width_ - 1.001));
  const double gy = std::clamp(y / cell_ - 0.5, 0.0, std::max(0.0, grid_height_ - 1.001));
  const auto ix = static_cast<int>(gx), iy = static_cast<int>(gy);
  const double ax = gx - ix, ay = gy - iy;
  const uint8_t* at = background_.data() + iy * grid_width_ + ix;
  const int down = grid_height_ > 1 ? grid_width_ : 0, right = grid_width_ > 1 ? 1 : 0;
  return (1 - ay) * ((1 - ax) * at[0] + ax * at[right]) + ay * ((1 - ax) * at[down] + ax * at[down + right]);
}

// Blobs that are none as they are go to again_, to be split at that part of their contrast; 0: not at all.
void MarkerDetector::MeasureBlobs(const cv::Mat& gray, double split_level) {
  again_.clear();
  for (const Blob& blob : blobs_) {
    if (blob.dropped) continue;
    const Levels levels = MeasureLevels(gray, blob);
    if (levels.contrast() < contrast_) continue;
    Measured measured;
    measured.contrast = levels.contrast();
    if (Measure(gray, blob, levels, measured.detection)) {
      measured_.push_back(measured);
    } else if (split_level > 0 && levels.contrast() > 3 * contrast_) {
      const auto level = static_cast<int>(levels.background + split_level * levels.contrast());
      for (int i = blob.first_run; i < blob.first_run + blob.runs; ++i) {
        const Run& run = sorted_[static_cast<size_t>(i)];
        again_.push_back({run.y, run.begin, run.end, i == blob.first_run ? -level : level});
      }
    }
  }
}

// The blob's gray levels, and those of the pixels that touch it from outside.
MarkerDetector::Levels MarkerDetector::MeasureLevels(const cv::Mat& gray, const Blob& blob) {
  Levels levels;
  const auto mean = static_cast<int>(blob.sum / blob.area);
  int bright_sum = 0, bright = 0;
  const Run* const first = sorted_.data() + blob.first_run;
  const Run* const last = first + blob.runs;
  for (const Run* run = first; run != last; ++run) {
    const uint8_t* row = gray.ptr(run->y);
    for (int x = run->begin; x < run->end; ++x) {
      const int counts = row[x] >= mean ? 1 : 0;
      bright_sum += counts * row[x];
      bright += counts;
    }
  }
  levels.peak = static_cast<double>(bright_sum) / std::max(1, bright);
  levels.background = BackgroundAt(0.5 * (blob.x0 + blob.x1 - 1), 0.5 * (blob.y0 + blob.y1 - 1));
  if (levels.contrast() < contrast_) return levels;

  const auto half = static_cast<int>(0.5 * (levels.background + levels.peak));
  int sum = 0, count = 0, dark = 0;
  const auto look = [&](int y, int begin, int end) {
    if (y < 0 || y >= height_) return;
    const uint8_t* row = gray.ptr(y);
    for (int x = std::max(begin, 0); x < std::min(end, width_); ++x) {
      sum += row[x], ++count;
      dark += row[x] < half ? 1 : 0;
    }
  };
  const Run* const before_first = first - 1;
  for (const Run* run = first; run != last; ++run) {
    look(run->y, run->begin - 1, run->begin);
    look(run->y, run->end, run->end + 1);
    // Above and below: what the first overlapping run of that row leaves free.
    for (const int step : {-1, 1}) {
      const int y = run->y + step;
      const Run* other = run;
      while (other != before_first && other != last && std::abs(other->y - run->y) <= 1 &&
             !(other->y == y && other->begin < run->end && other->end > run->begin)) {
        other += step;
      }
      const bool found = other != before_first && other != last && other->y == y;
      look(y, run->begin, found ? std::min(run->end, other->begin) : run->end);
      if (found) look(y, std::max(run->begin, other->end), run->end);
    }
  }
  levels.outline = static_cast<double>(sum) / std::max(1, count);
  levels.dark_outline = static_cast<double>(dark) / std::max(1, count);
  return levels;
}

// Centre by soft coverage: a pixel's weight rises from 0 to 1 between two levels of its blob's edge, so that
// the edge counts with its sub-pixel part and an uneven shade inside does not pull. Weights in 1/256.
bool MarkerDetector::Measure(const cv::Mat& gray, const Blob& blob, const Levels& levels,
                             Detection& detection) const {
  if (levels.dark_outline < options_.min_dark_outline) return false;
  // Small blobs are mostly edge: weights linear in the gray level keep every pixel's coverage.
  const bool small = blob.area < kSmallArea;
  const double low = std::max(levels.background + (small ? 0.1 : 0.25) * levels.contrast(),
                              std::min(levels.outline, levels.peak - 1));
  const double high = std::max(small ? levels.peak : 0.5 * (low + levels.peak), low + 1);
  const auto low16 = static_cast<int>(16 * low), slope = static_cast<int>(4096 / (high - low));
  const int x_middle = (blob.x0 + blob.x1) / 2, y_middle = (blob.y0 + blob.y1) / 2;
  int64_t w_sum = 0, wx = 0, wy = 0, wxx = 0, wxy = 0, wyy = 0, ramp = 0;
  const auto add = [&](int y, int begin, int end) {
    const uint8_t* row = gray.ptr(y);
    const int dy = y - y_middle;
    int64_t s0 = 0, s1 = 0, s2 = 0;
    for (int x = begin; x < end; ++x) {
      const int dx = x - x_middle;
      const int w = std::clamp(((16 * row[x] - low16) * slope) >> 8, 0, 256);
      s0 += w, s1 += w * dx, s2 += w * dx * dx;
      ramp += w > 0 && w < 256 ? dx * dx + dy * dy : 0;
    }
    w_sum += s0, wx += s1, wy += s0 * dy;
    wxx += s2, wxy += s1 * dy, wyy += s0 * dy * dy;
  };
  // Small blobs with a rim of a pixel, or a good part of their edge would be left out.
  const int rim = small ? 1 : 0;
  const Run* const first = sorted_.data() + blob.first_run;
  const Run* const last = first + blob.runs - 1;
  for (const Run* run = first; run <= last; ++run) {
    add(run->y, std::max(run->begin - rim, 0), std::min(run->end + rim, width_));
  }
  if (rim != 0 && first->y > 0) add(first->y - 1, first->begin, first->end);
  if (rim != 0 && last->y + 1 < height_) add(last->y + 1, last->begin, last->end);
  const double area = static_cast<double>(w_sum) / 256;
  if (area < 0.5 * options_.min_area_px2) return false;
  const auto mean = [&](int64_t sum) { return static_cast<double>(sum) / static_cast<double>(w_sum); };
  const double mx = mean(wx), my = mean(wy);
  detection.center_px = Vec2(x_middle + mx, y_middle + my);
  detection.width_px = blob.x1 - blob.x0;
  detection.height_px = blob.y1 - blob.y0;
  detection.area_px2 = area;
  detection.clipped = blob.x0 == 0 || blob.y0 == 0 || blob.x1 == width_ || blob.y1 == height_;
  const double size = std::sqrt(area);
  const double from_noise = noise_ * std::sqrt(0.5 * static_cast<double>(ramp)) / (area * (high - low));
  const double from_shade = options_.sigma_per_size * size;
  const double variance = detection.clipped ? 0.0625 * area
                                            : from_noise * from_noise + from_shade * from_shade +
                                                  options_.sigma_floor_px * options_.sigma_floor_px;
  detection.covariance_px2 = variance * Mat2::Identity();

  const double pixel = 1.0 / 12;  // second moment of a pixel itself
  const double xx = mean(wxx) - mx * mx + pixel, yy = mean(wyy) - my * my + pixel, xy = mean(wxy) - mx * my;
  const double middle = 0.5 * (xx + yy), spread = std::hypot(0.5 * (xx - yy), xy);
  const double longest = middle + spread, shortest = middle - spread;
  const double limit = options_.max_elongation * (detection.clipped ? 2 : 1);
  if (longest > limit * limit * shortest) return false;
  const double fill = area / (4 * std::numbers::pi * std::sqrt(longest * shortest));
  return fill > options_.min_fill - 2.5 / area && fill < options_.max_fill;
}

// Dust is much dimmer than the markers around it, which grow dim together towards the far end.
void MarkerDetector::DropSpecks(Detections& out) {
  const int columns = (width_ + kNeighbourhood - 1) / kNeighbourhood + 2;
  const int rows = (height_ + kNeighbourhood - 1) / kNeighbourhood + 2;
  cells_.assign(static_cast<size_t>(columns * rows), {});
  const auto cell_of = [&](const Vec2& p) {
    return (static_cast<int>(p.y()) / kNeighbourhood + 1) * columns +
           static_cast<int>(p.x()) / kNeighbourhood + 1;
  };
  Cell all;
  for (const Measured& m : measured_) {
    Cell& cell = cells_[static_cast<size_t>(cell_of(m.detection.center_px))];
    const double weight = std::sqrt(m.detection.area_px2);
    cell.weight += weight;
    cell.contrast += weight * m.contrast;
    all.weight += weight;
    all.contrast += weight * m.contrast;
  }
  // Where there are few neighbours, the whole picture counts as some more.
  if (all.weight > 0) {
    const double some = 4 / static_cast<double>(measured_.size());
    all = {some * all.weight, some * all.contrast};
  }
  for (const Measured& m : measured_) {
    const int center = cell_of(m.detection.center_px);
    Cell sum = all;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const Cell& cell = cells_[static_cast<size_t>(center + dy * columns + dx)];
        sum.weight += cell.weight;
        sum.contrast += cell.contrast;
      }
    }
    if (m.contrast > options_.min_relative_contrast * sum.contrast / sum.weight) out.push_back(m.detection);
  }
}

}  // namespace taclink

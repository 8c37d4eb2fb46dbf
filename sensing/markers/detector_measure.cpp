// MarkerDetector's second half: what a blob's centre is, and whether it is a marker.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sensing/markers/detector.h"

namespace taclink {
namespace {

constexpr int kSmallArea = 60;      // px^2
constexpr double kShadeDip = 0.3;   // of the height: uneven shade within one marker
constexpr double kLongest = 2;      // elongation from which two summits are two markers
constexpr double kInside = 0.7;     // of the contrast: brighter pixels tell the shade
constexpr int kLargeArea = 400;     // px^2
constexpr int kLeastArea = 5;       // px^2, of a blob that is measured by itself
constexpr int kNeighbourhood = 48;  // px, cells over which typical contrast is looked up

bool Covers(const Detection& d, const Vec2& p) {
  return std::abs(d.center_px.x() - p.x()) < d.width_px / 2 &&
         std::abs(d.center_px.y() - p.y()) < d.height_px / 2;
}

double Elongation(const Mat2& spread) {
  const double middle = 0.5 * spread.trace(),
               half = std::hypot(0.5 * (spread(0, 0) - spread(1, 1)), spread(0, 1));
  return std::sqrt((middle + half) / std::max(1e-9, middle - half));
}

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
    if (!first_level_ && blob.area < kSmallArea) continue;  // its summits were looked at
    const bool large = blob.area > kLargeArea;
    const double base = BackgroundAt(0.5 * (blob.x0 + blob.x1 - 1), 0.5 * (blob.y0 + blob.y1 - 1));
    if (first_level_ && !large) FindSummits(blob, base);
    const bool one = large || !first_level_ || bells_.CountSummits(base, kShadeDip) <= 1;
    double contrast = 0;
    if (one && !blob.odd && blob.area >= kLeastArea) {
      const Levels levels = MeasureLevels(gray, blob);
      Measured measured;
      measured.contrast = contrast = levels.contrast();
      if (contrast >= contrast_ && Measure(gray, blob, levels, measured) &&
          (large || !first_level_ || Elongation(measured.spread) < kLongest ||
           bells_.CountSummits(base, 0) <= 1)) {
        measured_.push_back(measured);
        continue;
      }
    }
    if (first_level_) {
      if (large) FindSummits(blob, base);
      bells_.TakeSummits();
    }
    if (split_level > 0 && blob.area >= kSmallArea) {
      if (contrast == 0) contrast = MeasureLevels(gray, blob).contrast();
      if (contrast < 3 * contrast_) continue;
      const auto level = static_cast<int>(base + split_level * contrast);
      for (int i = blob.first_run; i < blob.first_run + blob.runs; ++i) {
        const Run& run = sorted_[static_cast<size_t>(i)];
        again_.push_back({run.y, run.begin, run.end, i == blob.first_run ? -level : level});
      }
    }
  }
}

void MarkerDetector::FindSummits(const Blob& blob, double base) {
  bells_.OpenBox(blob.x0, blob.y0, blob.x1, blob.y1);
  for (int i = blob.first_run; i < blob.first_run + blob.runs; ++i) {
    const Run& run = sorted_[static_cast<size_t>(i)];
    bells_.AddSummits(run.y, run.begin, run.end);
  }
  bells_.MergeSummits(base);
}

// Bells that look like markers, and are no part of a larger one.
void MarkerDetector::TakeBells() {
  for (const Bell& bell : bells_.bells()) {
    if (bell.known || !bell.good || bell.height < contrast_) continue;
    const double det = bell.precision.determinant();
    if (!(det > 0)) continue;
    const Mat2 s = bell.precision.inverse();
    const double middle = 0.5 * s.trace(), spread = std::hypot(0.5 * (s(0, 0) - s(1, 1)), s(0, 1));
    const double longest = std::sqrt(middle + spread), shortest = std::sqrt(std::max(1e-9, middle - spread));
    if (longest > 5 || shortest < 0.45 || longest > options_.max_elongation * shortest) continue;
    if ((bell.center_px - bell.start_px).norm() > std::max(1.5, longest)) continue;
    if (bell.misfit > std::max(3 * noise_, 0.25 * bell.height)) continue;
    Measured measured;
    Detection& d = measured.detection;
    d.center_px = bell.center_px;
    d.area_px2 = 2 * std::numbers::pi * longest * shortest;
    d.width_px = 2.355 * std::sqrt(s(0, 0)) + 1;
    d.height_px = 2.355 * std::sqrt(s(1, 1)) + 1;
    // noise^2 / (height^2 pi det(s)^1/2) s for a bell alone.
    const double variance = std::max(noise_ * noise_ + 1.0 / 12, bell.misfit * bell.misfit);
    d.covariance_px2 =
        3 * variance / (std::numbers::pi * longest * shortest * bell.height * bell.height) * s +
        Floor(true) * Mat2::Identity();
    const Vec2 c = d.center_px;
    const double margin = 0.5;
    if (!(c.x() > -1 && c.y() > -1 && c.x() < width_ && c.y() < height_)) continue;
    d.clipped = c.x() < d.width_px / 2 - margin || c.y() < d.height_px / 2 - margin ||
                c.x() > width_ - 1 - d.width_px / 2 + margin ||
                c.y() > height_ - 1 - d.height_px / 2 + margin;
    measured.contrast = bell.height;
    measured_.push_back(measured);
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

// How the blob's inside brightens along x and y, per px, over its contrast.
Vec2 MarkerDetector::Shade(const cv::Mat& gray, const Blob& blob, const Levels& levels) const {
  const auto inside = static_cast<int>(levels.background + kInside * levels.contrast());
  const int x_middle = (blob.x0 + blob.x1) / 2, y_middle = (blob.y0 + blob.y1) / 2;
  int64_t n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, v = 0, vx = 0, vy = 0;
  for (int i = blob.first_run; i < blob.first_run + blob.runs; ++i) {
    const Run& run = sorted_[static_cast<size_t>(i)];
    const uint8_t* row = gray.ptr(run.y);
    const int dy = run.y - y_middle;
    int s = 0, sx = 0, sxx = 0, sv = 0, svx = 0;
    for (int px = run.begin; px < run.end; ++px) {
      const int dx = px - x_middle, w = row[px] > inside ? 1 : 0, wx = w * dx;
      s += w, sx += wx, sxx += wx * dx;
      sv += w * row[px], svx += wx * row[px];
    }
    n += s, x += sx, y += s * dy, xx += sxx, xy += sx * dy, yy += s * dy * dy;
    v += sv, vx += svx, vy += sv * dy;
  }
  if (n < 14) return Vec2::Zero();
  const auto over = [&](int64_t sum, int64_t a, int64_t b) {
    return static_cast<double>(sum) -
           static_cast<double>(a) * static_cast<double>(b) / static_cast<double>(n);
  };
  Mat2 m;
  m << over(xx, x, x), over(xy, x, y), over(xy, x, y), over(yy, y, y);
  if (m.determinant() < 1) return Vec2::Zero();
  const Vec2 slope = m.inverse() * Vec2(over(vx, v, x), over(vy, v, y)) / levels.contrast();
  const double most = 0.25 / std::sqrt(static_cast<double>(blob.area));
  return slope * std::min(1.0, most / std::max(slope.norm(), 1e-9));
}

// Sums of soft coverage: a pixel's weight rises from 0 to 1 between two levels of its blob's edge, so that
// the edge counts with its sub-pixel part. The shade inside is taken out first. Weights in 1/256.
MarkerDetector::Moments MarkerDetector::SumCoverage(const cv::Mat& gray, const Blob& blob,
                                                    const Levels& levels, double low, double high,
                                                    const Vec2& shade) const {
  Moments m;
  const auto base16 = static_cast<int>(16 * levels.background);
  const auto above16 = static_cast<int>(16 * (low - levels.background));
  const auto slope = static_cast<int>(4096 / (high - low));
  const auto gx = static_cast<int>(4096 * shade.x()), gy = static_cast<int>(4096 * shade.y());
  m.x = (blob.x0 + blob.x1) / 2, m.y = (blob.y0 + blob.y1) / 2;
  const auto add = [&](int y, int begin, int end) {
    const uint8_t* row = gray.ptr(y);
    const int dy = y - m.y;
    int64_t s0 = 0, s1 = 0, s2 = 0;
    for (int x = begin; x < end; ++x) {
      const int dx = x - m.x;
      const int flat = ((16 * row[x] - base16) * (4096 - gx * dx - gy * dy)) >> 12;
      const int w = std::clamp(((flat - above16) * slope) >> 8, 0, 256);
      s0 += w, s1 += w * dx, s2 += w * dx * dx;
      const int edge = w > 0 && w < 256 ? 1 : 0;
      m.ramp_xx += edge * dx * dx, m.ramp_xy += edge * dx * dy, m.ramp_yy += edge * dy * dy;
    }
    m.w += s0, m.wx += s1, m.wy += s0 * dy;
    m.wxx += s2, m.wxy += s1 * dy, m.wyy += s0 * dy * dy;
  };
  // Small blobs with a rim of a pixel, or a good part of their edge would be left out.
  const int rim = blob.area < kSmallArea ? 1 : 0;
  const Run* const first = sorted_.data() + blob.first_run;
  const Run* const last = first + blob.runs - 1;
  for (const Run* run = first; run <= last; ++run) {
    add(run->y, std::max(run->begin - rim, 0), std::min(run->end + rim, width_));
  }
  if (rim != 0 && first->y > 0) add(first->y - 1, first->begin, first->end);
  if (rim != 0 && last->y + 1 < height_) add(last->y + 1, last->begin, last->end);
  return m;
}

bool MarkerDetector::Measure(const cv::Mat& gray, const Blob& blob, const Levels& levels,
                             Measured& measured) const {
  if (levels.dark_outline < options_.min_dark_outline) return false;
  // Small blobs are mostly edge: weights linear in the gray level keep every pixel's coverage.
  const bool small = blob.area < kSmallArea;
  const double low = std::max(levels.background + (small ? 0.1 : 0.25) * levels.contrast(),
                              std::min(levels.outline, levels.peak - 1));
  const double high = std::max(small ? levels.peak : 0.5 * (low + levels.peak), low + 1);
  const Vec2 shade = Shade(gray, blob, levels);
  const Moments m = SumCoverage(gray, blob, levels, low, high, shade);
  const double area = static_cast<double>(m.w) / 256;
  if (area < 0.5 * options_.min_area_px2) return false;
  const auto mean = [&](int64_t sum) { return static_cast<double>(sum) / static_cast<double>(m.w); };
  const double mx = mean(m.wx), my = mean(m.wy);
  const double pixel = 1.0 / 12;  // second moment of a pixel itself
  const double xx = mean(m.wxx) - mx * mx + pixel, yy = mean(m.wyy) - my * my + pixel,
               xy = mean(m.wxy) - mx * my;
  measured.spread << xx, xy, xy, yy;
  const double middle = 0.5 * (xx + yy), spread = std::hypot(0.5 * (xx - yy), xy);
  const double longest = middle + spread, shortest = middle - spread;
  Detection& d = measured.detection;
  d.clipped = blob.x0 == 0 || blob.y0 == 0 || blob.x1 == width_ || blob.y1 == height_;
  const double limit = options_.max_elongation * (d.clipped ? 2 : 1);
  if (longest > limit * limit * shortest) return false;
  const double fill = area / (4 * std::numbers::pi * std::sqrt(longest * shortest));
  if (fill < options_.min_fill - 2.5 / area || fill > options_.max_fill) return false;

  d.center_px = Vec2(m.x + mx, m.y + my);
  d.width_px = blob.x1 - blob.x0;
  d.height_px = blob.y1 - blob.y0;
  d.area_px2 = area;
  // Pixel noise moves the edge's pixels; what is left of the shade moves with size, along the longer axis
  // more.
  const double noise = noise_ * noise_ + 1.0 / 12, per_level = 1 / (area * (high - low));
  Mat2 ramp;
  ramp << static_cast<double>(m.ramp_xx), static_cast<double>(m.ramp_xy), static_cast<double>(m.ramp_xy),
      static_cast<double>(m.ramp_yy);
  // What departs from an ellipse may be half another marker.
  const double odd = d.clipped ? 0 : 2 * std::max(0.0, std::abs(1 - fill) - 0.04 - 2.5 / area);
  const double by_size = 4 * std::numbers::pi * options_.sigma_per_size * options_.sigma_per_size;
  d.covariance_px2 = noise * per_level * per_level * ramp + (by_size + odd * odd) * measured.spread +
                     Floor(small) * Mat2::Identity();
  if (d.clipped) CompleteClipped(blob, d);
  return true;
}

// A blob that one side of the picture cuts is taken for an ellipse with its axes along that side: the chord
// there against the longest one says how far its middle is from the edge. Cut beyond its middle it says
// little, and the covariance across the edge grows.
void MarkerDetector::CompleteClipped(const Blob& blob, Detection& d) const {
  const bool left = blob.x0 == 0, right = blob.x1 == width_, top = blob.y0 == 0, bottom = blob.y1 == height_;
  if (int{left} + int{right} + int{top} + int{bottom} != 1) {
    d.covariance_px2 += 0.0625 * d.area_px2 * Mat2::Identity();
    return;
  }
  const bool upright = top || bottom;  // cut along x
  const int lines = upright ? blob.y1 - blob.y0 : blob.x1 - blob.x0;
  double chord = 0, longest = 0;
  if (upright) {
    for (int i = blob.first_run; i < blob.first_run + blob.runs; ++i) {
      const Run& run = sorted_[static_cast<size_t>(i)];
      const int length = run.end - run.begin;
      longest = std::max<double>(longest, length);
      if (run.y == (top ? 0 : height_ - 1)) chord = std::max<double>(chord, length);
    }
  } else {
    longest = blob.y1 - blob.y0;
    for (int i = blob.first_run; i < blob.first_run + blob.runs; ++i) {
      const Run& run = sorted_[static_cast<size_t>(i)];
      chord += (left ? run.begin == 0 : run.end == width_) ? 1 : 0;
    }
  }
  const double part = std::min(1.0, chord / std::max(1.0, longest));
  const double inside = std::sqrt(1 - part * part);  // the middle's distance over the half axis
  const double from_edge = lines * inside / (1 + inside) - 0.5;
  double& across = upright ? d.center_px.y() : d.center_px.x();
  const double end = top || left ? 0 : (top || bottom ? height_ : width_) - 1;
  across = top || left ? end + from_edge : end - from_edge;
  const double sigma = 0.06 * lines + 0.3 * (1 - inside) * std::max<double>(lines, 0.5 * longest);
  const double along = (0.03 + 0.03 * (1 - inside)) * longest;
  Mat2 more;
  more << (upright ? along * along : sigma * sigma), 0, 0, (upright ? sigma * sigma : along * along);
  d.covariance_px2 += more;
}

void MarkerDetector::Neighbourhoods::Clear(int width, int height) {
  columns = (width + kNeighbourhood - 1) / kNeighbourhood + 2;
  const int rows = (height + kNeighbourhood - 1) / kNeighbourhood + 2;
  cells.assign(static_cast<size_t>(columns) * static_cast<size_t>(rows), {});
  all = {};
  count = 0;
}

size_t MarkerDetector::Neighbourhoods::Of(const Vec2& p) const {
  const int x = static_cast<int>(std::max(0.0, p.x())) / kNeighbourhood + 1,
            y = static_cast<int>(std::max(0.0, p.y())) / kNeighbourhood + 1;
  return std::min(cells.size() - static_cast<size_t>(columns) - 2, static_cast<size_t>(y * columns + x));
}

void MarkerDetector::Neighbourhoods::Add(const Vec2& p, double size_px, double contrast) {
  Cell& cell = cells[Of(p)];
  cell.weight += size_px;
  cell.contrast += size_px * contrast;
  all.weight += size_px;
  all.contrast += size_px * contrast;
  ++count;
}

// The mean around; where there is little, the whole picture counts as some more.
double MarkerDetector::Neighbourhoods::Typical(const Vec2& p) const {
  if (count == 0) return 0;
  const double some = 4.0 / count;
  Cell sum{some * all.weight, some * all.contrast};
  const auto center = static_cast<std::ptrdiff_t>(Of(p));
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const Cell& cell = cells[static_cast<size_t>(center + dy * columns + dx)];
      sum.weight += cell.weight;
      sum.contrast += cell.contrast;
    }
  }
  return sum.weight > 0 ? sum.contrast / sum.weight : 0;
}

// Dust is much dimmer than the markers around it, which grow dim together towards the far end.
void MarkerDetector::DropDimBells() {
  around_.Clear(width_, height_);
  for (const Measured& m : measured_)
    around_.Add(m.detection.center_px, std::sqrt(m.detection.area_px2), m.contrast);
  for (const Bell& b : bells_.bells())
    around_.Add(b.center_px, 1.5 / std::pow(b.precision.determinant(), 0.25), b.height);
  bells_.DropIf([&](const Bell& bell) {
    if (bell.height < 0.7 * options_.min_relative_contrast * around_.Typical(bell.center_px)) return true;
    return std::any_of(measured_.begin(), measured_.end(),
                       [&](const Measured& m) { return Covers(m.detection, bell.center_px); });
  });
}

void MarkerDetector::DropSpecks(Detections& out) {
  around_.Clear(width_, height_);
  for (const Measured& m : measured_)
    around_.Add(m.detection.center_px, std::sqrt(m.detection.area_px2), m.contrast);
  for (const Measured& m : measured_) {
    if (m.contrast > options_.min_relative_contrast * around_.Typical(m.detection.center_px))
      out.push_back(m.detection);
  }
}

}  // namespace taclink

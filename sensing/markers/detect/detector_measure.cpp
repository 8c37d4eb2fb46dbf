// MarkerDetector's second half: what a blob's centre is, and whether it is a marker.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sensing/markers/detect/detector.h"

namespace taclink {
namespace {

constexpr int kSmallArea = 60;       // px^2
constexpr double kShadeDip = 0.3;    // of the height: uneven shade within one marker
constexpr double kLongest = 2;       // elongation from which two summits are two markers
constexpr double kInside = 0.7;      // of the contrast: brighter pixels tell the shade
constexpr double kSharp = 0.8;       // px: a blur that does no harm
constexpr double kBlurError = 0.13;  // px per px^2 of blur beyond that
constexpr int kLargeArea = 400;      // px^2
constexpr int kLeastArea = 5;        // px^2, of a blob that is measured by itself
constexpr int kNeighbourhood = 48;   // px, cells over which typical contrast is looked up

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
      if (contrast >= contrast_ && Measure(blob, levels, measured) &&
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

// The blob's gray levels, and those of the pixels that touch it from outside. Leaves the blob in box_.
MarkerDetector::Levels MarkerDetector::MeasureLevels(const cv::Mat& gray, const Blob& blob) {
  box_.Open(gray, blob.x0, blob.y0, blob.x1, blob.y1);
  for (int i = blob.first_run; i < blob.first_run + blob.runs; ++i) {
    const Run& run = sorted_[static_cast<size_t>(i)];
    box_.AddRun(run.y, run.begin, run.end);
  }
  box_.Close();
  Levels levels;
  const BlobBox::Sum bright = box_.AtLeast(box_.AtLeast(1).levels / blob.area);
  levels.peak = static_cast<double>(bright.levels) / std::max(1, bright.pixels);
  levels.background = BackgroundAt(0.5 * (blob.x0 + blob.x1 - 1), 0.5 * (blob.y0 + blob.y1 - 1));
  if (levels.contrast() < contrast_) return levels;
  const BlobBox::Outline outline = box_.Around(static_cast<int>(0.5 * (levels.background + levels.peak)));
  levels.outline = static_cast<double>(outline.levels) / std::max(1, outline.pixels);
  levels.dark_outline = static_cast<double>(outline.dark) / std::max(1, outline.pixels);
  return levels;
}

// How the blob's inside brightens along x and y, per px, over its contrast.
Vec2 MarkerDetector::Shade(const Blob& blob, const Levels& levels) const {
  const BlobBox::Inside in = box_.Above(static_cast<int>(levels.background + kInside * levels.contrast()));
  if (in.n < 14) return Vec2::Zero();
  Mat2 m;
  m << in.xx - in.x * in.x / in.n, in.xy - in.x * in.y / in.n, in.xy - in.x * in.y / in.n,
      in.yy - in.y * in.y / in.n;
  if (m.determinant() < 1) return Vec2::Zero();
  const Vec2 slope =
      m.inverse() * Vec2(in.vx - in.v * in.x / in.n, in.vy - in.v * in.y / in.n) / levels.contrast();
  const double most = 0.25 / std::sqrt(static_cast<double>(blob.area));
  return slope * std::min(1.0, most / std::max(slope.norm(), 1e-9));
}

// Of the blob in box_. Its soft coverage: a pixel's weight rises from 0 to 1 between two levels of its edge,
// so that the edge counts with its sub-pixel part. The shade inside is taken out first.
bool MarkerDetector::Measure(const Blob& blob, const Levels& levels, Measured& measured) {
  if (levels.dark_outline < options_.min_dark_outline) return false;
  // Small blobs are mostly edge: weights linear in the gray level keep every pixel's coverage.
  const bool small = blob.area < kSmallArea;
  const double low = std::max(levels.background + (small ? 0.1 : 0.25) * levels.contrast(),
                              std::min(levels.outline, levels.peak - 1));
  const double high = std::max(small ? levels.peak : 0.5 * (low + levels.peak), low + 1);
  const Vec2 shade = Shade(blob, levels);
  // Small blobs with a rim of a pixel, or a good part of their edge would be left out.
  if (small) box_.Widen();
  const BlobBox::Coverage m =
      box_.Cover({levels.background, low - levels.background, high - levels.background, shade});
  const double area = m.w;
  if (area < 0.5 * options_.min_area_px2) return false;
  const double mx = m.x / area, my = m.y / area;
  const double pixel = 1.0 / 12;  // second moment of a pixel itself
  const double xx = m.xx / area - mx * mx + pixel, yy = m.yy / area - my * my + pixel,
               xy = m.xy / area - mx * my;
  measured.spread << xx, xy, xy, yy;
  const double middle = 0.5 * (xx + yy), spread = std::hypot(0.5 * (xx - yy), xy);
  const double longest = middle + spread, shortest = middle - spread;
  Detection& d = measured.detection;
  d.clipped = blob.x0 == 0 || blob.y0 == 0 || blob.x1 == width_ || blob.y1 == height_;
  const double limit = options_.max_elongation * (d.clipped ? 2 : 1);
  if (longest > limit * limit * shortest) return false;
  const double fill = area / (4 * std::numbers::pi * std::sqrt(longest * shortest));
  if (fill < options_.min_fill - 2.5 / area || fill > options_.max_fill) return false;

  d.center_px = box_.middle() + Vec2(mx, my);
  d.width_px = blob.x1 - blob.x0;
  d.height_px = blob.y1 - blob.y0;
  d.area_px2 = area;
  // Pixel noise moves the edge's pixels; what is left of the shade moves with size, along the longer axis
  // more.
  const double noise = noise_ * noise_ + 1.0 / 12, per_level = 1 / (area * (high - low));
  Mat2 ramp;
  ramp << m.edge_xx, m.edge_xy, m.edge_xy, m.edge_yy;
  // What departs from an ellipse may be half another marker.
  const double odd = d.clipped ? 0 : 2 * std::max(0.0, std::abs(1 - fill) - 0.04 - 2.5 / area);
  const double by_size = 4 * std::numbers::pi * options_.sigma_per_size * options_.sigma_per_size;
  d.covariance_px2 = noise * per_level * per_level * ramp + (by_size + odd * odd) * measured.spread +
                     Floor(small) * Mat2::Identity();
  if (d.clipped) {
    CompleteClipped(blob, d);
  } else if (!small) {
    edge_area_ += m.edge;
    edge_length_ += 2 * std::numbers::pi * std::sqrt(2 * (longest + shortest));
  }
  return true;
}

// An edge counts as such from a quarter of the contrast to five eighths, one sigma of the blur. Where that is
// wide, light of neighbours and of the wall around reaches into a blob, and moves its centre, all alike.
double MarkerDetector::BlurVariance() const {
  const double blur = edge_length_ > 0 ? edge_area_ / edge_length_ : 0;
  const double more = std::max(0.0, blur * blur - kSharp * kSharp);
  return kBlurError * kBlurError * more * more;
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
  const Mat2 blur = BlurVariance() * Mat2::Identity();
  for (Measured& m : measured_) {
    m.detection.covariance_px2 += blur;
    if (m.contrast > options_.min_relative_contrast * around_.Typical(m.detection.center_px))
      out.push_back(m.detection);
  }
}

}  // namespace taclink

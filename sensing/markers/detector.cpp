#include "sensing/markers/detector.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

namespace taclink {
namespace {

constexpr int kHalfWindow = 3;  // of the local mean
constexpr int kWindowArea = (2 * kHalfWindow + 1) * (2 * kHalfWindow + 1);
constexpr int kBlock = 4;      // the background is the darkest mean of such blocks: calmer than single pixels
constexpr int kOpening = 2;    // cells each way: the opening is 5 cells wide, more than a near marker
constexpr int kMeanSlack = 3;  // gray levels below the local mean that still count, for flat insides
constexpr int kSlackPerContrast = 5;  // and 5/49 of the contrast
constexpr int kHole = 3;              // px: shorter gaps in a blob's row are shade or a scratch
constexpr double kSplitLevels[] = {0.5, 0.7};

// Minimum or maximum over 2 * kOpening + 1 cells along one axis of a grid.
template <typename Choose>
void Slide(const uint8_t* in, uint8_t* out, int width, int height, int dx, int dy, Choose choose) {
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      uint8_t best = in[y * width + x];
      for (int k = -kOpening; k <= kOpening; ++k) {
        const int xx = std::clamp(x + k * dx, 0, width - 1), yy = std::clamp(y + k * dy, 0, height - 1);
        best = choose(best, in[yy * width + xx]);
      }
      out[y * width + x] = best;
    }
  }
}

// Both tests for a row. s[x] ... s[x + 6] are the column sums of the 7 columns around x.
void ChoosePixels(const uint8_t* __restrict row, const int16_t* __restrict background,
                  const int16_t* __restrict s, int16_t contrast, int width, uint8_t* __restrict chosen) {
  for (int x = 0; x < width; ++x) {
    const auto around =
        static_cast<int16_t>(s[x] + s[x + 1] + s[x + 2] + s[x + 3] + s[x + 4] + s[x + 5] + s[x + 6]);
    const auto above = static_cast<int16_t>(row[x] - background[x]);
    const auto own = static_cast<int16_t>((row[x] + kMeanSlack) * kWindowArea + kSlackPerContrast * above);
    chosen[x] = static_cast<uint8_t>((above > contrast ? 1 : 0) & (own > around ? 1 : 0));
  }
}

}  // namespace

MarkerDetector::MarkerDetector(DetectorOptions options) : options_(options) {}

void MarkerDetector::Resize(int width, int height) {
  if (width == width_ && height == height_) return;
  width_ = width, height_ = height;
  cell_ = std::max(8, kBlock * (height / 240));  // near markers grow with the picture
  grid_width_ = (width + cell_ - 1) / cell_, grid_height_ = (height + cell_ - 1) / cell_;
  const auto cells = static_cast<size_t>(grid_width_ * grid_height_);
  background_.resize(cells);
  grid_scratch_.resize(cells);
  block_sums_.resize(static_cast<size_t>(width));
  column_sums_.resize(static_cast<size_t>(width + 2 * kHalfWindow));
  row_background_.resize(static_cast<size_t>(width));
  chosen_.assign(static_cast<size_t>(width) + 16, 0);
}

void MarkerDetector::Detect(const cv::Mat& gray, Detections& out) {
  out.clear();
  if (gray.empty() || gray.type() != CV_8UC1 || gray.cols < 16 || gray.rows < 16) return;
  Resize(gray.cols, gray.rows);
  EstimateNoise(gray);
  FindBackground(gray);
  FindRuns(gray);
  CollectBlobs(gray);
  measured_.clear();
  bells_.Begin(gray, noise_, contrast_);
  first_level_ = true;
  for (const double level : kSplitLevels) {
    MeasureBlobs(gray, level);
    first_level_ = false;
    SplitAgain(gray);
    CollectBlobs(gray);
  }
  MeasureBlobs(gray, 0);
  DropDimBells();
  if (!bells_.bells().empty()) {
    for (const Measured& m : measured_) {
      if (m.detection.area_px2 < 150) bells_.AddKnown(m.detection.center_px, m.spread, m.contrast);
    }
    bells_.Fit();
  }
  TakeBells();
  DropSpecks(out);
}

// From the median step between neighbours, which edges hardly move: |N(0, 2 sigma^2)| has median 0.954 sigma.
void MarkerDetector::EstimateNoise(const cv::Mat& gray) {
  std::array<int, 256> histogram{}, levels{};
  int count = 0;
  for (int y = 4; y < height_; y += 8) {
    const uint8_t* row = gray.ptr(y);
    for (int x = 0; x + 1 < width_; x += 2, ++count) {
      ++histogram[static_cast<size_t>(std::abs(row[x] - row[x + 1]))];
      ++levels[row[x]];
    }
  }
  int below = 0;
  size_t step = 0;
  while (2 * (below + histogram[step]) < count) below += histogram[step++];
  // Within the step, linearly: the steps are coarse against the noise.
  const double part = (0.5 * count - below) / std::max(1, histogram[step]);
  noise_ = std::max(0.7, (static_cast<double>(step) - 0.5 + part) / 0.954);
  size_t median = 0;
  for (int sum = levels[0]; 2 * sum < count; sum += levels[++median]) {
  }
  contrast_ = std::max({options_.min_contrast, 3.5 * noise_, 0.4 * static_cast<double>(median)});
}

void MarkerDetector::FindBackground(const cv::Mat& gray) {
  std::fill(background_.begin(), background_.end(), uint8_t{255});
  uint16_t* sums = block_sums_.data();
  for (int y0 = 0; y0 + kBlock <= height_; y0 += kBlock) {
    const uint8_t *r0 = gray.ptr(y0), *r1 = gray.ptr(y0 + 1), *r2 = gray.ptr(y0 + 2), *r3 = gray.ptr(y0 + 3);
    for (int x = 0; x < width_; ++x) sums[x] = static_cast<uint16_t>(r0[x] + r1[x] + r2[x] + r3[x]);
    uint8_t* cells = background_.data() + (y0 / cell_) * grid_width_;
    for (int x0 = 0; x0 + kBlock <= width_; x0 += kBlock) {
      const int mean = (sums[x0] + sums[x0 + 1] + sums[x0 + 2] + sums[x0 + 3]) / (kBlock * kBlock);
      cells[x0 / cell_] = std::min(cells[x0 / cell_], static_cast<uint8_t>(mean));
    }
  }
  const auto least = [](uint8_t a, uint8_t b) { return std::min(a, b); };
  const auto most = [](uint8_t a, uint8_t b) { return std::max(a, b); };
  uint8_t *grid = background_.data(), *scratch = grid_scratch_.data();
  Slide(grid, scratch, grid_width_, grid_height_, 1, 0, least);
  Slide(scratch, grid, grid_width_, grid_height_, 0, 1, least);
  Slide(grid, scratch, grid_width_, grid_height_, 1, 0, most);
  Slide(scratch, grid, grid_width_, grid_height_, 0, 1, most);
}

void MarkerDetector::FindRuns(const cv::Mat& gray) {
  runs_.clear();
  parents_.clear();
  // Sums over the rows y - 3 ... y + 3, the edge rows repeated.
  int16_t* sums = column_sums_.data() + kHalfWindow;
  std::fill(column_sums_.begin(), column_sums_.end(), int16_t{0});
  for (int k = -kHalfWindow; k <= kHalfWindow; ++k) {
    const uint8_t* row = gray.ptr(std::max(k, 0));
    for (int x = 0; x < width_; ++x) sums[x] = static_cast<int16_t>(sums[x] + row[x]);
  }
  for (int y = 0; y < height_; ++y) {
    if (y > 0) {
      const uint8_t* in = gray.ptr(std::min(y + kHalfWindow, height_ - 1));
      const uint8_t* gone = gray.ptr(std::max(y - kHalfWindow - 1, 0));
      for (int x = 0; x < width_; ++x) sums[x] = static_cast<int16_t>(sums[x] + in[x] - gone[x]);
    }
    for (int k = 1; k <= kHalfWindow; ++k) {
      sums[-k] = sums[0];
      sums[width_ - 1 + k] = sums[width_ - 1];
    }
    ChooseRow(gray, y);
    AppendRuns(y, 0, width_);
  }
}

void MarkerDetector::ChooseRow(const cv::Mat& gray, int y) {
  if (y % cell_ == 0) {
    const uint8_t* cells = background_.data() + (y / cell_) * grid_width_;
    for (int x = 0; x < width_; ++x) row_background_[static_cast<size_t>(x)] = cells[x / cell_];
  }
  const auto contrast = static_cast<int16_t>(std::lround(contrast_));
  ChoosePixels(gray.ptr(y), row_background_.data(), column_sums_.data(), contrast, width_, chosen_.data());
}

int MarkerDetector::Root(int label) {
  while (parents_[static_cast<size_t>(label)] != label) {
    int& parent = parents_[static_cast<size_t>(label)];
    parent = parents_[static_cast<size_t>(parent)];
    label = parent;
  }
  return label;
}

// Joins runs that touch along a pixel's side: corners would join neighbouring markers.
void MarkerDetector::AppendRuns(int y, int x_begin, int x_end) {
  const size_t previous_end = runs_.size();
  size_t previous = previous_end;
  while (previous > 0 && runs_[previous - 1].y == y - 1) --previous;
  const uint8_t* chosen = chosen_.data();
  for (int x = x_begin; x < x_end;) {
    uint64_t eight = 0;
    std::memcpy(&eight, chosen + x, sizeof eight);  // zeros follow the row
    if (eight == 0) {
      x += 8;
      continue;
    }
    x += std::countr_zero(eight) / 8;
    const int begin = x;
    while (x < x_end && chosen[x] != 0) ++x;
    if (x == begin) break;  // past the end
    int label = -1;
    while (previous < previous_end && runs_[previous].end <= begin) ++previous;
    for (size_t i = previous; i < previous_end && runs_[i].begin < x; ++i) {
      const int other = Root(runs_[i].label);
      if (label < 0) label = other;
      const int low = std::min(label, other), high = std::max(label, other);
      parents_[static_cast<size_t>(high)] = low;
      label = low;
    }
    if (label < 0) label = NewLabel();
    runs_.push_back({y, begin, x, label});
  }
}

int MarkerDetector::NewLabel() {
  const auto label = static_cast<int>(parents_.size());
  parents_.push_back(label);
  return label;
}

void MarkerDetector::CollectBlobs(const cv::Mat& gray) {
  blob_of_label_.assign(parents_.size(), -1);
  blobs_.clear();
  for (Run& run : runs_) {
    const auto root = static_cast<size_t>(Root(run.label));
    if (blob_of_label_[root] < 0) {
      blob_of_label_[root] = static_cast<int>(blobs_.size());
      blobs_.push_back({.x0 = run.begin, .x1 = run.end, .y0 = run.y, .y1 = run.y + 1});
    }
    run.label = blob_of_label_[root];
    Blob& blob = blobs_[static_cast<size_t>(run.label)];
    ++blob.runs;
    blob.area += run.end - run.begin;
    blob.x0 = std::min(blob.x0, run.begin), blob.x1 = std::max(blob.x1, run.end);
    blob.y1 = run.y + 1;
  }
  const double max_area = options_.max_area_fraction * width_ * height_;
  int first = 0;
  for (Blob& blob : blobs_) {
    blob.dropped = blob.area < 3;
    blob.odd = blob.area > max_area || blob.area < 0.3 * (blob.x1 - blob.x0) * (blob.y1 - blob.y0);
    blob.first_run = first;
    first += blob.runs;
    blob.runs = 0;
  }
  sorted_.resize(runs_.size());
  for (const Run& run : runs_) {
    Blob& blob = blobs_[static_cast<size_t>(run.label)];
    if (blob.dropped) continue;
    int begin = run.begin;
    Run* const before = sorted_.data() + blob.first_run + blob.runs - 1;
    if (blob.runs > 0 && before->y == run.y && run.begin - before->end <= kHole) {
      begin = before->end;
      before->end = run.end;
      blob.area += run.begin - begin;
    } else {
      sorted_[static_cast<size_t>(blob.first_run + blob.runs++)] = run;
    }
    const uint8_t* row = gray.ptr(run.y);
    for (int x = begin; x < run.end; ++x) blob.sum += row[x];
  }
}

// Blobs that hang together by something dimmer, such as a glow, come apart at a higher level. again_ holds
// their runs with that level as label, negative at a blob's first run.
void MarkerDetector::SplitAgain(const cv::Mat& gray) {
  runs_.clear();
  parents_.clear();
  std::fill(chosen_.begin(), chosen_.end(), uint8_t{0});
  for (size_t i = 0; i < again_.size();) {
    const int y = again_[i].y;
    if (again_[i].label < 0) runs_.push_back({-2, 0, 0, NewLabel()});  // parts it from the blob before
    const size_t first = i;
    do {
      const Run& run = again_[i];
      const uint8_t* row = gray.ptr(y);
      for (int x = run.begin; x < run.end; ++x) {
        chosen_[static_cast<size_t>(x)] = row[x] > std::abs(run.label) ? 1 : 0;
      }
      ++i;
    } while (i < again_.size() && again_[i].y == y && again_[i].label >= 0);
    AppendRuns(y, again_[first].begin, again_[i - 1].end);
    for (size_t k = first; k < i; ++k) {
      std::fill(chosen_.begin() + again_[k].begin, chosen_.begin() + again_[k].end, uint8_t{0});
    }
  }
}

}  // namespace taclink

#include "sensing/markers/detect/detector.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "sensing/markers/detect/lanes.h"

namespace taclink {
namespace {

constexpr int kHalfWindow = 3;  // of the local mean
constexpr int kWindowArea = (2 * kHalfWindow + 1) * (2 * kHalfWindow + 1);
constexpr int kBlock = 4;      // the background is the darkest mean of such blocks: calmer than single pixels
constexpr int kOpening = 2;    // cells each way: the opening is 5 cells wide, more than a near marker
constexpr int kMeanSlack = 3;  // gray levels below the local mean that still count, for flat insides
constexpr int kSlackPerContrast = 5;  // and 5/49 of the contrast
constexpr int kHole = 3;              // px: shorter gaps in a blob's row are shade or a scratch
constexpr uint64_t kEachByte = 0x0101010101010101ULL;
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

// Lowers `least`, one for each whole 4 px along a row, to the sum of the 4 x 4 block that begins there.
void LowerToSums(const uint8_t* p, std::ptrdiff_t step, int width, int32_t* least) {
  static_assert(kBlock == 4);
  int x = 0;
  for (; x + 16 <= width; x += 16, least += 4) {
    Shorts8 pairs{};
    for (int k = 0; k < kBlock; ++k) {
      const auto sixteen = reinterpret_cast<Shorts8>(LoadSixteen(p + k * step + x));
      pairs += (sixteen & 255) + (sixteen >> 8);
    }
    const auto both = reinterpret_cast<Ints4>(pairs);
    const Ints4 sums = (both & 0xffff) + (both >> 16);
    Ints4 before;
    std::memcpy(&before, least, sizeof before);
    const Ints4 now = sums < before ? sums : before;
    std::memcpy(least, &now, sizeof now);
  }
  for (; x + kBlock <= width; x += kBlock, ++least) {
    int sum = 0;
    for (int k = 0; k < kBlock * kBlock; ++k) sum += p[k / kBlock * step + x + k % kBlock];
    *least = std::min(*least, sum);
  }
}

// The brightest of each 8 px from there to the right, over some rows; `out` is 8 longer than the row.
void BrightestOfEight(const uint8_t* p, std::ptrdiff_t step, int rows, int width, uint8_t* __restrict out) {
  std::memcpy(out, p, static_cast<size_t>(width));
  std::memset(out + width, 0, 8);
  for (int k = 1; k < rows; ++k) {
    const uint8_t* __restrict row = p + k * step;
    for (int x = 0; x < width; ++x) out[x] = std::max(out[x], row[x]);
  }
  for (int shift = 1; shift < 8; shift *= 2) {
    for (int x = 0; x < width; x += static_cast<int>(sizeof(Bytes16))) {
      const Bytes16 here = LoadSixteen(out + x), there = LoadSixteen(out + x + shift);
      const Bytes16 most = here > there ? here : there;
      std::memcpy(out + x, &most, sizeof most);
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
  brightest_.resize(cells);
  block_least_.resize(static_cast<size_t>(grid_width_ * cell_ / kBlock));
  row_brightest_.resize(static_cast<size_t>(grid_width_ * cell_) + 32);
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
  CollectBlobs();
  measured_.clear();
  edge_area_ = edge_length_ = 0;
  bells_.Begin(gray, noise_, contrast_);
  first_level_ = true;
  for (const double level : kSplitLevels) {
    MeasureBlobs(gray, level);
    first_level_ = false;
    SplitAgain(gray);
    CollectBlobs();
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
    for (int x = 0; x + 1 < width_; x += 4, ++count) {
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
  const auto step = static_cast<std::ptrdiff_t>(gray.step[0]);
  for (int row = 0; row < grid_height_; ++row) {
    const int y0 = row * cell_, rows = std::min(cell_, height_ - y0);
    std::fill(block_least_.begin(), block_least_.end(), 255 * kBlock * kBlock);
    for (int y = y0; y + kBlock <= y0 + rows; y += kBlock) {
      LowerToSums(gray.ptr(y), step, width_, block_least_.data());
    }
    BrightestOfEight(gray.ptr(y0), step, rows, width_, row_brightest_.data());
    const int32_t* least = block_least_.data();
    const uint8_t* most = row_brightest_.data();
    for (int cell = row * grid_width_; cell < (row + 1) * grid_width_;
         ++cell, least += cell_ / kBlock, most += cell_) {
      const auto c = static_cast<size_t>(cell);
      int darkest = least[0];
      for (int i = 1; i < cell_ / kBlock; ++i) darkest = std::min(darkest, least[i]);
      background_[c] = static_cast<uint8_t>(darkest / (kBlock * kBlock));
      brightest_[c] = most[0];
      for (int x = kBlock; x + 2 * kBlock <= cell_; x += kBlock)
        brightest_[c] = std::max(brightest_[c], most[x]);
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
  }
}

// The spans of a row of cells in which anything is bright enough, and their background by pixel.
void MarkerDetector::FindSpans(int row) {
  spans_.clear();
  std::fill(chosen_.begin(), chosen_.end(), uint8_t{0});
  const int first = row * grid_width_, contrast = Contrast();
  for (int i = 0; i < grid_width_; ++i) {
    const auto cell = static_cast<size_t>(first + i);
    if (brightest_[cell] <= background_[cell] + contrast) continue;
    const int begin = i * cell_, end = std::min(begin + cell_, width_);
    std::fill(row_background_.begin() + begin, row_background_.begin() + end, int16_t{background_[cell]});
    if (!spans_.empty() && spans_.back().end == begin) {
      spans_.back().end = end;
    } else {
      spans_.push_back({begin, end});
    }
  }
}

void MarkerDetector::ChooseRow(const cv::Mat& gray, int y) {
  if (y % cell_ == 0) FindSpans(y / cell_);
  if (spans_.empty()) return;
  const auto contrast = static_cast<int16_t>(Contrast());
  for (const Span& span : spans_) {
    ChoosePixels(gray.ptr(y) + span.begin, row_background_.data() + span.begin,
                 column_sums_.data() + span.begin, contrast, span.end - span.begin,
                 chosen_.data() + span.begin);
  }
  AppendRuns(y, spans_.front().begin, spans_.back().end);
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
    const uint64_t eight = LoadEight(chosen + x);  // zeros follow the row
    if (eight == 0) {
      x += 8;
      continue;
    }
    x += std::countr_zero(eight) / 8;
    if (x >= x_end) break;
    const int begin = x;
    uint64_t gap = 0;
    while ((gap = ~LoadEight(chosen + x) & kEachByte) == 0) x += 8;
    x += std::countr_zero(gap) / 8;
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

void MarkerDetector::CollectBlobs() {
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
    Run* const before = sorted_.data() + blob.first_run + blob.runs - 1;
    if (blob.runs > 0 && before->y == run.y && run.begin - before->end <= kHole) {
      blob.area += run.begin - before->end;
      before->end = run.end;
    } else {
      sorted_[static_cast<size_t>(blob.first_run + blob.runs++)] = run;
    }
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

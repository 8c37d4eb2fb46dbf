#include "sensing/pipeline/image_noise.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "sensing/core/median.h"

namespace taclink {
namespace {

constexpr int kRowStep = 32;
constexpr double kNoiseDeviations = 4;  // a larger difference is an edge
constexpr double kSigmaPerMedian = 1.4826;
constexpr int kLeastNoisy = 200;  // pixels
constexpr size_t kMostRestCorrelations = 64, kLeastLearned = 3;
// Live simulated images correlate by 0.0, compressed ones by 0.1 (JPEG quality 80) to 0.45 (50); an image
// that is compressed again with another quality by 0.36 to 0.97, mostly above 0.8.
// Where live images correlate by more than kMostUsual (temporal denoising, a fixed pattern, coarse
// compression) the noise does not distinguish images, and only identical ones are recognised.
constexpr double kUsual = 0.2, kMostUsual = 0.8;
constexpr int64_t kRateNs = 1'000'000'000;
constexpr int kLeastReturns = 3;  // new images after repeated ones; a camera that hangs has one at most

// Of all pixels, eight at a time; 0: an image of one brightness, which need not have noise.
uint64_t HashOf(const cv::Mat& gray) {
  constexpr uint64_t kPrime = 0x9E3779B97F4A7C15U;
  uint64_t hash = kPrime;
  bool is_uniform = true;
  for (int row = 0; row < gray.rows; ++row) {
    const uchar* pixels = gray.ptr(row);
    const uint64_t first = 0x0101010101010101U * gray.at<uchar>(0, 0);
    int column = 0;
    for (; column + 8 <= gray.cols; column += 8) {
      uint64_t word = 0;
      std::memcpy(&word, pixels + column, sizeof word);
      is_uniform = is_uniform && word == first;
      hash = std::rotl((hash ^ word) * kPrime, 29);
    }
    for (; column < gray.cols; ++column) {
      is_uniform = is_uniform && pixels[column] == gray.at<uchar>(0, 0);
      hash = std::rotl((hash ^ pixels[column]) * kPrime, 29);
    }
  }
  return is_uniform ? 0 : std::max<uint64_t>(hash, 1);
}

}  // namespace

bool AreIdentical(const cv::Mat& now, const cv::Mat& before) {
  if (now.empty() || now.size() != before.size()) return false;
  // Stops at the first pixel that differs: of a sensor with noise, one of the first. Images without light
  // need not have noise.
  bool is_uniform = true;
  for (int row = 0; row < now.rows; ++row) {
    const uchar* pixels = now.ptr(row);
    if (!std::equal(pixels, pixels + now.cols, before.ptr(row))) return false;
    is_uniform = is_uniform && std::all_of(pixels, pixels + now.cols,
                                           [&](uchar pixel) { return pixel == now.at<uchar>(0, 0); });
  }
  return !is_uniform;
}

void NoiseSample::Take(const cv::Mat& gray) {
  differences_.clear();
  constexpr int kMostDifference = 4 * 255;
  std::array<int, kMostDifference + 1> counts{};
  for (int row = kRowStep / 2; row < gray.rows; row += kRowStep) {
    const uchar* pixels = gray.ptr(row);
    for (int column = 1; column + 1 < gray.cols; ++column) {
      const int difference = 2 * pixels[column] - pixels[column - 1] - pixels[column + 1];
      ++counts[static_cast<size_t>(std::abs(difference))];
      differences_.push_back(static_cast<int16_t>(difference));
    }
  }
  int median = 0;
  for (size_t below = 0; median < kMostDifference; ++median) {
    below += static_cast<size_t>(counts[static_cast<size_t>(median)]);
    if (2 * below >= differences_.size()) break;
  }
  most_ = static_cast<int>(std::lround(kNoiseDeviations * kSigmaPerMedian * std::max(1, median)));
}

std::optional<double> NoiseSample::Correlation(const NoiseSample& a, const NoiseSample& b) {
  if (a.differences_.size() != b.differences_.size()) return std::nullopt;
  int64_t products = 0, squares_a = 0, squares_b = 0;
  int noisy = 0;
  for (size_t i = 0; i < a.differences_.size(); ++i) {
    const int one = a.differences_[i], other = b.differences_[i];
    if (std::abs(one) > a.most_ || std::abs(other) > b.most_) continue;
    products += one * other;
    squares_a += one * one;
    squares_b += other * other;
    noisy += one != 0 || other != 0 ? 1 : 0;
  }
  if (noisy < kLeastNoisy || squares_a == 0 || squares_b == 0) return std::nullopt;
  return static_cast<double>(products) /
         std::sqrt(static_cast<double>(squares_a) * static_cast<double>(squares_b));
}

ImageRepetition::ImageRepetition() : usual_(kUsual) {
  rest_correlations_.reserve(kMostRestCorrelations);
}

// Images without noise, of a test pattern, may come again.
bool ImageRepetition::WasShown(uint64_t hash) const {
  if (hash == 0 || hashed_ == 0) return false;
  return is_noise_random_ ? std::ranges::find(hashes_, hash) != hashes_.end()
                          : hash == hashes_[(hashed_ - 1) % kRemembered];
}

void ImageRepetition::Miss() {
  taken_ = 0;
  judged_ = 0;
  is_repeated_ = false;
}

bool ImageRepetition::KeepsNoise() const {
  if (judged_ < kJudged || !is_noise_random_) return false;
  std::array<double, kJudged> sorted = correlations_;
  std::ranges::nth_element(sorted, sorted.begin() + kJudged / 2);
  return sorted[kJudged / 2] > 0.5 * (1 + usual_);
}

void ImageRepetition::Learn(double correlation) {
  if (rest_correlations_.size() == kMostRestCorrelations)
    rest_correlations_.erase(rest_correlations_.begin());
  rest_correlations_.push_back(correlation);
  std::vector<double> sorted = rest_correlations_;
  const double median = Median(sorted);
  is_noise_random_ = sorted.size() >= kLeastLearned && median <= kMostUsual;
  usual_ = std::max(median, kUsual);
}

void ImageRepetition::Take(const cv::Mat& gray, int64_t exposure_ns, bool is_rest) {
  newest_ = 1 - newest_;
  samples_[newest_].Take(gray);
  const uint64_t hash = HashOf(gray);
  const bool is_same = WasShown(hash);
  hashes_[hashed_++ % kRemembered] = hash;
  ++taken_;
  const auto correlation = taken_ > 1 ? NoiseSample::Correlation(samples_[0], samples_[1]) : std::nullopt;
  if (correlation && is_rest && !is_same) Learn(*correlation);
  if (!correlation)
    judged_ = 0;
  else if (!is_same)
    correlations_[judged_++ % kJudged] = *correlation;
  is_repeated_ = is_same || KeepsNoise();
  shown_[shown_count_++ % kShown] = {exposure_ns, !is_repeated_};
}

std::optional<ImageRepetition::Rates> ImageRepetition::rates() const {
  const size_t count = std::min(shown_count_, kShown);
  const auto ago = [&](size_t images) { return shown_[(shown_count_ - 1 - images) % kShown]; };
  size_t all = 0;
  int new_images = 0, returns = 0;
  for (; all < count; ++all) {
    const Shown shown = ago(all);
    const int64_t passed_ns = ago(0).exposure_ns - shown.exposure_ns;
    if (shown.exposure_ns <= 0 || passed_ns < 0 || passed_ns > kRateNs) break;
    new_images += shown.is_new ? 1 : 0;
    returns += all > 0 && ago(all - 1).is_new && !shown.is_new ? 1 : 0;
  }
  if (returns < kLeastReturns) return std::nullopt;
  const double span_s = 1e-9 * static_cast<double>(ago(0).exposure_ns - ago(all - 1).exposure_ns);
  const double all_hz = static_cast<double>(all - 1) / span_s;
  return Rates{.new_hz = all_hz * new_images / static_cast<double>(all), .all_hz = all_hz};
}

}  // namespace taclink

#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace taclink {

/// Second differences of brightness along some rows of an image. Where the image is flat they are the
/// sensor's noise, which differs from image to image of a live camera.
class NoiseSample {
 public:
  /// `gray`: CV_8UC1. Reuses its memory for images of one size.
  void Take(const cv::Mat& gray);

  /// Correlation coefficient of two samples of images of one size, over the pixels where both are flat. None:
  /// too few pixels show noise, as in images without light.
  static std::optional<double> Correlation(const NoiseSample& a, const NoiseSample& b);

 private:
  std::vector<int16_t> differences_;
  int most_ = 0;  // above: no noise, but an edge
};

/// Whether two images are identical, pixel by pixel. Uniform ones are not: images without light need not have
/// noise.
bool AreIdentical(const cv::Mat& one, const cv::Mat& other);

/// Whether a camera gives new images. One that hangs may give the last image again and again, with times and
/// sequence numbers that go on, or encoded again each time: then its noise stays. A driver may also send its
/// buffers by turns without filling them: then an image is identical to one of the last kRemembered. One
/// thread.
class ImageRepetition {
 public:
  ImageRepetition();

  /// An image, when it was exposed (monotonic, ns), and whether it is one of the rest images, from which the
  /// camera's usual correlation of noise is learned: sensors have a fixed pattern, and compression takes
  /// noise away. Before some are learned, only identical images count as repeated.
  void Take(const cv::Mat& gray, int64_t exposure_ns, bool is_rest);
  /// There was no image.
  void Miss();

  /// The last image is not new.
  bool is_repeated() const { return is_repeated_; }
  struct Rates {
    double new_hz = 0, all_hz = 0;
  };
  /// Images a second in the last second, where the camera repeats some of them; none: all are new, or none
  /// is.
  std::optional<Rates> rates() const;
  const NoiseSample& noise() const { return samples_[newest_]; }

 private:
  bool WasShown(uint64_t hash) const;
  bool KeepsNoise() const;
  void Learn(double correlation);

  static constexpr size_t kShown = 64, kJudged = 7, kRemembered = 64;
  struct Shown {
    int64_t exposure_ns = 0;
    bool is_new = true;
  };
  std::array<NoiseSample, 2> samples_;
  size_t newest_ = 0;
  int taken_ = 0;                               // samples in a row
  std::array<double, kJudged> correlations_{};  // of the last images, by turns
  size_t judged_ = 0;                           // all that were taken
  std::array<uint64_t, kRemembered> hashes_{};  // of the last images, by turns; 0: none, or of one brightness
  size_t hashed_ = 0;                           // all that were taken
  std::vector<double> rest_correlations_;
  double usual_;                  // correlation of live images
  bool is_noise_random_ = false;  // live images are known to correlate little
  std::array<Shown, kShown> shown_{};
  size_t shown_count_ = 0;
  bool is_repeated_ = false;
};

}  // namespace taclink

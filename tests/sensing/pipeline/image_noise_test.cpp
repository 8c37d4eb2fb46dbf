#include "sensing/pipeline/image_noise.h"

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "sensing/capture/decode.h"
#include "sensing/capture/encode.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/temporal_smoothing.h"
#include "sensing/simulation/renderer.h"
#include "tests/support/studio.h"

namespace taclink {
namespace {

constexpr int64_t kFrameNs = 33'000'000;

class ImageRepetitionTest : public ::testing::Test {
 protected:
  ImageRepetitionTest() {
    for (int i = 0; i < 10; ++i) Show(Live(), true);
  }

  cv::Mat Live() {
    cv::Mat gray;
    truth_.frame = frames_++;  // picks the noise
    renderer_.Render(truth_, CameraId::kTop, gray);
    return gray;
  }
  cv::Mat Compressed(const cv::Mat& gray, int quality) {
    RawImage image;
    image.format = PixelFormat::kMjpeg;
    image.width_px = gray.cols;
    image.height_px = gray.rows;
    image.valid = encoder_.Encode(gray, quality, image.bytes).ok();
    cv::Mat decoded;
    EXPECT_TRUE(decoder_.Decode(image, decoded).ok());
    return decoded;
  }
  void Show(const cv::Mat& gray, bool is_rest = false) {
    now_ns_ += kFrameNs;
    repetition_.Take(gray, now_ns_, is_rest);
    before_ = gray.clone();
  }
  void ShowNew(int images) {
    for (int i = 0; i < images; ++i) {
      Show(Live());
      EXPECT_FALSE(repetition_.is_repeated()) << i;
    }
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const Studio studio_{model_};
  SkinTruth truth_ = studio_.Truth();
  Renderer renderer_{model_, model_.nominal_rig, CameraEffects{}, 1};
  JpegEncoder encoder_;
  GrayDecoder decoder_;
  uint64_t frames_ = 0;
  int64_t now_ns_ = 0;
  cv::Mat before_;
  ImageRepetition repetition_;
};

TEST_F(ImageRepetitionTest, LiveImagesAreNew) {
  ShowNew(100);
  EXPECT_FALSE(repetition_.rates());
}

TEST_F(ImageRepetitionTest, TheSameImageIsRepeatedAtOnce) {
  ShowNew(10);
  const cv::Mat last = before_;
  Show(last);
  EXPECT_TRUE(repetition_.is_repeated());
  EXPECT_FALSE(repetition_.rates()) << "it may hang";
  ShowNew(3);
}

// A driver that sends its buffers by turns without filling them.
TEST_F(ImageRepetitionTest, ImagesThatComeByTurnsAreRepeated) {
  std::vector<cv::Mat> buffers;
  for (int i = 0; i < 8; ++i) {
    buffers.push_back(Live());
    Show(buffers.back());
    EXPECT_FALSE(repetition_.is_repeated());
  }
  for (size_t i = 0; i < 24; ++i) {
    Show(buffers[i % buffers.size()]);
    EXPECT_TRUE(repetition_.is_repeated()) << i;
  }
  ShowNew(3);
}

// An encoder that keeps to a rate.
TEST_F(ImageRepetitionTest, AReencodedImageIsRepeated) {
  ShowNew(10);
  const cv::Mat last = before_;
  for (int i = 0; i < 60; ++i) {
    Show(Compressed(last, 80 + i % 10));
    EXPECT_TRUE(repetition_.is_repeated() || i < 4) << i;
  }
  for (int i = 0; i < 4; ++i) Show(Live());
  ShowNew(10);
}

TEST_F(ImageRepetitionTest, LiveCompressedImagesAreNew) {
  for (int i = 0; i < 100; ++i) {
    Show(Compressed(Live(), 60 + i % 30));
    EXPECT_FALSE(repetition_.is_repeated()) << i;
  }
}

// A sensor whose noise is the same in every image.
TEST_F(ImageRepetitionTest, WhereNoiseIsAPatternOnlyIdenticalImagesAreRepeated) {
  ImageRepetition repetition;
  const cv::Mat pattern = Live();
  cv::Mat gray;
  for (int i = 0; i < 60; ++i) {
    gray = pattern.clone();
    gray.at<uchar>(i, i) = static_cast<uchar>(gray.at<uchar>(i, i) + 1);
    repetition.Take(gray, i * kFrameNs, i < 10);
    EXPECT_FALSE(repetition.is_repeated()) << i;
  }
  repetition.Take(gray, 60 * kFrameNs, false);
  EXPECT_TRUE(repetition.is_repeated());
}

TEST_F(ImageRepetitionTest, ASkinThatMovesIsNew) {
  truth_ = studio_.Truth(
      "  - {at: {path: 7, ring: 5}, patch_diameter_mm: 20, depth_mm: 5, begin_s: 0, end_s: 2}\n");
  ShowNew(20);
}

TEST_F(ImageRepetitionTest, OfEverySecondImageTheRateIsTold) {
  for (int i = 0; i < 40; ++i) {
    const cv::Mat live = Live();
    Show(live);
    Show(live);
    EXPECT_TRUE(repetition_.is_repeated());
  }
  const auto rates = repetition_.rates();
  ASSERT_TRUE(rates);
  EXPECT_NEAR(rates->all_hz, 1e9 / kFrameNs, 0.1);
  EXPECT_NEAR(rates->new_hz, 0.5e9 / kFrameNs, 1);
}

TEST_F(ImageRepetitionTest, TwoCamerasHaveTheirOwnNoise) {
  NoiseSample top, bottom;
  cv::Mat gray;
  renderer_.Render(truth_, CameraId::kTop, gray);
  top.Take(gray);
  renderer_.Render(truth_, CameraId::kBottom, gray);
  bottom.Take(gray);
  EXPECT_LT(std::abs(NoiseSample::Correlation(top, bottom).value()), 0.1);
  EXPECT_DOUBLE_EQ(NoiseSample::Correlation(top, top).value(), 1);
  NoiseSample dark;
  dark.Take(cv::Mat::zeros(gray.size(), CV_8U));
  EXPECT_FALSE(NoiseSample::Correlation(dark, dark)) << "without noise nothing is known";
}

class TemporalSmoothingTest : public ImageRepetitionTest {
 protected:
  // Of eight images, each `made` of a live one.
  std::optional<double> ShareOf(const std::function<cv::Mat(const cv::Mat&)>& made) {
    TemporalSmoothing smoothing;
    for (int i = 0; i < 8; ++i) smoothing.Take(made(Live()), true);
    smoothing.Take(Live(), false);
    return smoothing.share();
  }
};

TEST_F(TemporalSmoothingTest, TheShareOfTheImageBeforeIsFound) {
  for (const double share : {0.3, 0.5, 0.85}) {
    cv::Mat blended;
    Live().convertTo(blended, CV_32F);
    for (int i = 0; i < 30; ++i) cv::accumulateWeighted(Live(), blended, 1 - share);
    const auto found = ShareOf([&](const cv::Mat& live) {
      cv::accumulateWeighted(live, blended, 1 - share);
      cv::Mat sent;
      blended.convertTo(sent, CV_8U);
      return sent;
    });
    ASSERT_TRUE(found) << share;
    EXPECT_LT(*found, share + 0.08);
    EXPECT_GT(*found, 0.6 * share) << "rounding to 8 bits is noise, too";
  }
}

TEST_F(TemporalSmoothingTest, OtherCamerasDoNotSmooth) {
  EXPECT_EQ(ShareOf([](const cv::Mat& live) { return live; }), std::nullopt);
  for (const int quality : {50, 80})
    EXPECT_EQ(ShareOf([&](const cv::Mat& live) { return Compressed(live, quality); }), std::nullopt);
  cv::Mat pattern(480, 640, CV_8U);
  cv::randu(pattern, 0, 8);
  EXPECT_EQ(ShareOf([&](const cv::Mat& live) { return cv::Mat(live + pattern); }), std::nullopt);
  const cv::Mat held = Live();
  EXPECT_EQ(ShareOf([&](const cv::Mat&) { return held; }), std::nullopt) << "a file that repeats";
  EXPECT_EQ(ShareOf([&](const cv::Mat&) { return cv::Mat(480, 640, CV_8U, cv::Scalar(9)); }), std::nullopt);
}

}  // namespace
}  // namespace taclink

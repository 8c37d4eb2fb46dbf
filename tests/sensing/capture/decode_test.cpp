#include "sensing/capture/decode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "sensing/capture/image_io.h"
#include "tests/sensing/capture/pictures.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

constexpr int kWidth = 64, kHeight = 48;

RawImage Image(PixelFormat format, std::vector<uint8_t> bytes, int width_px = kWidth,
               int height_px = kHeight) {
  return {format, width_px, height_px, std::move(bytes), true};
}

std::vector<uint8_t> Yuyv(const cv::Mat& gray) {
  std::vector<uint8_t> bytes;
  for (int y = 0; y < gray.rows; ++y) {
    for (int x = 0; x < gray.cols; ++x) {
      bytes.push_back(gray.at<uint8_t>(y, x));
      bytes.push_back(static_cast<uint8_t>(x % 2 ? 90 : 200));  // colour, which must not matter
    }
  }
  return bytes;
}

std::string DecodeError(const RawImage& image) {
  cv::Mat gray;
  const auto decoded = GrayDecoder().Decode(image, gray);
  if (decoded) return "accepted";
  EXPECT_EQ(decoded.error().code, ErrorCode::kInvalidArgument);
  return decoded.error().message;
}

TEST(GrayDecoder, YuyvAndGrayAreExact) {
  const cv::Mat picture = SlopePicture(kWidth, kHeight);
  GrayDecoder decoder;
  cv::Mat gray;
  ASSERT_TRUE(decoder.Decode(Image(PixelFormat::kYuyv, Yuyv(picture)), gray));
  EXPECT_EQ(LargestDifference(gray, picture), 0);
  std::vector<uint8_t> bytes(picture.datastart, picture.dataend);
  bytes.resize(bytes.size() + 100);  // drivers may round up
  ASSERT_TRUE(decoder.Decode(Image(PixelFormat::kGray8, bytes), gray));
  EXPECT_EQ(LargestDifference(gray, picture), 0);
}

TEST(GrayDecoder, MjpegIsCloseAndTheMemoryIsReused) {
  GrayDecoder decoder;
  cv::Mat gray;
  const uint8_t* memory = nullptr;
  for (int seed = 0; seed < 30; seed += 10) {
    const cv::Mat picture = SlopePicture(kWidth, kHeight, seed);
    ASSERT_TRUE(decoder.Decode(Image(PixelFormat::kMjpeg, EncodeJpeg(picture)), gray));
    EXPECT_LE(LargestDifference(gray, picture), 3);
    if (memory) {
      EXPECT_EQ(gray.data, memory);
    }
    memory = gray.data;
  }
}

TEST(JpegSize, IsWhatTheHeaderSays) {
  std::vector<uint8_t> bytes = EncodeJpeg(SlopePicture(kWidth, kHeight));
  bytes.resize(bytes.size() / 2);  // the header is whole
  const auto size = JpegSize(bytes);
  ASSERT_TRUE(size.ok()) << size.error().message;
  EXPECT_EQ(size->width_px, kWidth);
  EXPECT_EQ(size->height_px, kHeight);
  EXPECT_FALSE(JpegSize({}).ok());
  EXPECT_FALSE(JpegSize(std::vector<uint8_t>(100, 0xff)).ok());
}

TEST(GrayDecoder, AMatrixThatIsPartOfAnotherIsReplaced) {
  cv::Mat whole(100, 100, CV_8UC1, cv::Scalar(7));
  cv::Mat part = whole(cv::Rect(10, 10, kWidth, kHeight));
  const cv::Mat picture = SlopePicture(kWidth, kHeight);
  ASSERT_TRUE(GrayDecoder().Decode(Image(PixelFormat::kYuyv, Yuyv(picture)), part));
  EXPECT_EQ(LargestDifference(part, picture), 0);
  EXPECT_EQ(whole.at<uint8_t>(20, 20), 7);
}

TEST(GrayDecoder, TakesMjpegAsCamerasSendIt) {
  const cv::Mat picture = SlopePicture(kWidth, kHeight);
  std::vector<uint8_t> no_tables = EncodeJpeg(picture);
  constexpr std::array<uint8_t, 2> kHuffmanTables = {0xff, 0xc4};
  for (auto at = no_tables.begin();
       (at = std::search(no_tables.begin(), no_tables.end(), kHuffmanTables.begin(), kHuffmanTables.end())) !=
       no_tables.end();) {
    no_tables.erase(at, at + 2 + 256 * at[2] + at[3]);
  }
  std::vector<uint8_t> padded = EncodeJpeg(picture);
  padded.insert(padded.end() - 2, {0, 0, 0, 0, 0, 0});
  std::vector<uint8_t> trailing = EncodeJpeg(picture);
  trailing.resize(trailing.size() + 500);
  for (const auto& bytes : {no_tables, padded, trailing}) {
    cv::Mat gray;
    const auto decoded = GrayDecoder().Decode(Image(PixelFormat::kMjpeg, bytes), gray);
    ASSERT_TRUE(decoded) << decoded.error().message;
    EXPECT_LE(LargestDifference(gray, picture), 3);
  }
}

TEST(GrayDecoder, ShortPicturesAreRefused) {
  std::vector<uint8_t> yuyv = Yuyv(SlopePicture(kWidth, kHeight));
  yuyv.pop_back();
  EXPECT_THAT(DecodeError(Image(PixelFormat::kYuyv, yuyv)),
              HasSubstr("short picture: 6143 bytes of 6144 for 64x48 YUYV"));
  EXPECT_THAT(DecodeError(Image(PixelFormat::kGray8, {})), HasSubstr("short picture: 0 bytes"));
  RawImage missing = Image(PixelFormat::kYuyv, Yuyv(SlopePicture(kWidth, kHeight)));
  missing.valid = false;
  EXPECT_THAT(DecodeError(missing), HasSubstr("no picture"));
}

TEST(GrayDecoder, ImpossibleSizesAreRefused) {
  for (const auto& [width, height] :
       {std::pair{0, 48}, {64, -1}, {kMaxPictureSidePx + 1, 1}, {1 << 30, 1 << 30}}) {
    EXPECT_THAT(DecodeError(Image(PixelFormat::kYuyv, {}, width, height)), HasSubstr("picture size"));
  }
}

TEST(GrayDecoder, DamagedMjpegIsRefusedAndTheNextOneIsFine) {
  const cv::Mat picture = SlopePicture(kWidth, kHeight);
  const std::vector<uint8_t> whole = EncodeJpeg(picture);
  EXPECT_THAT(DecodeError(Image(PixelFormat::kMjpeg, {})), HasSubstr("no bytes"));
  EXPECT_THAT(DecodeError(Image(PixelFormat::kMjpeg, {1, 2, 3, 4})), HasSubstr("not a JPEG"));
  EXPECT_THAT(DecodeError(Image(PixelFormat::kMjpeg, whole, kWidth, kHeight + 1)),
              HasSubstr("JPEG picture is 64x48, not 64x49"));
  const std::vector<uint8_t> half(whole.begin(),
                                  whole.begin() + static_cast<std::ptrdiff_t>(whole.size() / 2));
  EXPECT_THAT(DecodeError(Image(PixelFormat::kMjpeg, half)), HasSubstr("JPEG"));
  std::vector<uint8_t> ended_early = half;
  ended_early.insert(ended_early.end(), {0xff, 0xd9});
  EXPECT_THAT(DecodeError(Image(PixelFormat::kMjpeg, ended_early)), HasSubstr("JPEG"));

  GrayDecoder decoder;
  cv::Mat gray;
  EXPECT_FALSE(decoder.Decode(Image(PixelFormat::kMjpeg, half), gray));
  ASSERT_TRUE(decoder.Decode(Image(PixelFormat::kMjpeg, whole), gray));
  EXPECT_LE(LargestDifference(gray, picture), 3);
}

TEST(GrayDecoder, RandomDamageNeverCrashes) {
  const std::vector<uint8_t> whole = EncodeJpeg(SlopePicture(kWidth, kHeight));
  std::mt19937 random(1);
  GrayDecoder decoder;
  cv::Mat gray;
  int refused = 0;
  for (int i = 0; i < 2000; ++i) {
    std::vector<uint8_t> bytes = whole;
    for (int change = 0; change < 3; ++change)
      bytes[random() % bytes.size()] = static_cast<uint8_t>(random());
    bytes.resize(1 + random() % bytes.size());
    refused += decoder.Decode(Image(PixelFormat::kMjpeg, bytes), gray) ? 0 : 1;
  }
  EXPECT_GT(refused, 1900);
}

}  // namespace
}  // namespace taclink

#include "sensing/capture/encode.h"

#include <gtest/gtest.h>

#include "sensing/capture/decode.h"
#include "tests/sensing/capture/pictures.h"

namespace taclink {
namespace {

TEST(JpegEncoder, ADecoderSeesThePicture) {
  const cv::Mat picture = SlopePicture(64, 48);
  JpegEncoder encoder;
  std::vector<uint8_t> bytes;
  ASSERT_TRUE(encoder.Encode(picture, 95, bytes).ok());
  RawImage image{PixelFormat::kMjpeg, 64, 48, bytes, true};
  cv::Mat seen;
  ASSERT_TRUE(GrayDecoder().Decode(image, seen).ok());
  EXPECT_LE(LargestDifference(seen, picture), 4);
}

TEST(JpegEncoder, PartOfAPictureToo) {
  const cv::Mat picture = SlopePicture(64, 48);
  const cv::Mat part = picture(cv::Rect(10, 5, 31, 17));
  std::vector<uint8_t> bytes;
  ASSERT_TRUE(JpegEncoder().Encode(part, 95, bytes).ok());
  const auto size = JpegSize(bytes);
  ASSERT_TRUE(size.ok());
  EXPECT_EQ(size->width_px, 31);
  EXPECT_EQ(size->height_px, 17);
}

TEST(JpegEncoder, RefusesWhatIsNotGray) {
  std::vector<uint8_t> bytes;
  EXPECT_FALSE(JpegEncoder().Encode(cv::Mat(), 80, bytes).ok());
  EXPECT_FALSE(JpegEncoder().Encode(cv::Mat(4, 4, CV_8UC3), 80, bytes).ok());
}

}  // namespace
}  // namespace taclink

#include "sensing/capture/image_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/core.hpp>
#include <random>

#include "tests/sensing/capture/pictures.h"
#include "tests/support/paths.h"

namespace taclink {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// Any of libpng's simple formats, `pixels` in that format.
void WriteAnyPng(const std::string& path, png_uint_32 format, png_uint_32 width_px, png_uint_32 height_px,
                 const void* pixels, const void* colors = nullptr) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = width_px;
  image.height = height_px;
  image.format = format;
  image.colormap_entries = colors ? 2 : 0;
  ASSERT_TRUE(png_image_write_to_file(&image, path.c_str(), 0, pixels, 0, colors)) << image.message;
}

std::string ReadError(const std::string& path, ErrorCode code = ErrorCode::kInvalidArgument) {
  const auto picture = ReadGrayImage(path);
  if (picture) return "accepted";
  EXPECT_EQ(picture.error().code, code);
  EXPECT_THAT(picture.error().message, HasSubstr(path));
  return picture.error().message;
}

class ImageIo : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  const std::string path_ = folder_ / "picture";  // what it is does not depend on the name
};

TEST_F(ImageIo, GrayPngRoundTripIsExact) {
  const cv::Mat picture = SlopePicture(61, 37);
  ASSERT_TRUE(WritePng(path_, picture));
  const auto read = ReadGrayImage(path_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(LargestDifference(*read, picture), 0);
}

TEST_F(ImageIo, APartOfAPictureIsWrittenAlone) {
  const cv::Mat picture = SlopePicture(61, 37), part = picture(cv::Rect(5, 6, 20, 10));
  ASSERT_TRUE(WritePng(path_, part));
  EXPECT_EQ(LargestDifference(*ReadGrayImage(path_), part), 0);
}

TEST_F(ImageIo, ColoursBecomeLuma) {
  ASSERT_TRUE(WritePng(path_, cv::Mat(4, 5, CV_8UC3, cv::Scalar(200, 100, 50))));  // blue, green, red
  const auto read = ReadGrayImage(path_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_NEAR(read->at<uint8_t>(2, 2), 0.114 * 200 + 0.587 * 100 + 0.299 * 50, 1);
}

TEST_F(ImageIo, EveryKindOfPngIsRead) {
  const std::vector<uint16_t> bits16(6, 0xffff);
  WriteAnyPng(path_, PNG_FORMAT_LINEAR_Y, 3, 2, bits16.data());
  EXPECT_EQ(ReadGrayImage(path_)->at<uint8_t>(1, 2), 255);
  const std::vector<uint8_t> indices = {0, 1, 1, 0, 1, 1}, colors = {0, 0, 0, 255, 255, 255};
  WriteAnyPng(path_, PNG_FORMAT_RGB_COLORMAP, 3, 2, indices.data(), colors.data());
  EXPECT_EQ(ReadGrayImage(path_)->at<uint8_t>(0, 0), 0);
  EXPECT_EQ(ReadGrayImage(path_)->at<uint8_t>(1, 2), 255);
  const std::vector<uint8_t> transparent = {255, 255, 255, 0, 255, 255, 255, 255};
  WriteAnyPng(path_, PNG_FORMAT_RGBA, 2, 1, transparent.data());
  EXPECT_EQ(ReadGrayImage(path_)->at<uint8_t>(0, 0), 0);
  EXPECT_EQ(ReadGrayImage(path_)->at<uint8_t>(0, 1), 255);
}

TEST_F(ImageIo, JpegIsRead) {
  const cv::Mat picture = SlopePicture(61, 37);
  WriteBytes(path_, EncodeJpeg(picture));
  const auto read = ReadGrayImage(path_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_LE(LargestDifference(*read, picture), 3);
  const auto real = ReadGrayImage(testing::TestData("barrel_real_bottom.jpg"));
  ASSERT_TRUE(real) << real.error().message;
  EXPECT_EQ(real->size(), cv::Size(640, 480));
}

TEST_F(ImageIo, InfoNeedsOnlyTheBeginning) {
  ASSERT_TRUE(WritePng(path_, SlopePicture(61, 37)));
  const auto png = ReadImageInfo(path_);
  ASSERT_TRUE(png);
  EXPECT_EQ(png->format, PixelFormat::kGray8);
  EXPECT_EQ(png->width_px, 61);
  WriteBytes(path_, EncodeJpeg(SlopePicture(61, 37)));
  const auto jpeg = ReadImageInfo(path_);
  ASSERT_TRUE(jpeg);
  EXPECT_EQ(jpeg->format, PixelFormat::kMjpeg);
  EXPECT_EQ(jpeg->height_px, 37);
}

TEST_F(ImageIo, InfoFindsASizeBehindLongMetadata) {
  std::vector<uint8_t> bytes = EncodeJpeg(SlopePicture(61, 37));
  std::vector<uint8_t> comment = {0xff, 0xfe, 0xff, 0x00};
  comment.resize(2 + 0xff00);
  bytes.insert(bytes.begin() + 2, comment.begin(), comment.end());
  WriteBytes(path_, bytes);
  const auto info = ReadImageInfo(path_);
  ASSERT_TRUE(info) << info.error().message;
  EXPECT_EQ(info->width_px, 61);
}

TEST_F(ImageIo, WhatIsNoPictureIsNamed) {
  EXPECT_THAT(ReadError(folder_ / "missing.png", ErrorCode::kNotFound), HasSubstr("No such file"));
  EXPECT_THAT(ReadError(folder_.path(), ErrorCode::kInvalidArgument), HasSubstr("is a folder"));
  WriteBytes(path_, {});
  EXPECT_THAT(ReadError(path_), HasSubstr("is empty"));
  WriteBytes(path_, {'G', 'I', 'F', '8', '9', 'a', 0, 0, 0, 0, 0, 0});
  EXPECT_THAT(ReadError(path_), HasSubstr("is not a PNG or JPEG picture"));
}

TEST_F(ImageIo, TruncatedFilesAreRefused) {
  ASSERT_TRUE(WritePng(path_, SlopePicture(61, 37)));
  const std::vector<uint8_t> png = ReadBytes(path_), jpeg = EncodeJpeg(SlopePicture(61, 37));
  for (const auto& whole : {png, jpeg}) {
    for (size_t size = 4; size + 20 < whole.size(); size += 1 + size / 8) {
      WriteBytes(path_, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)});
      EXPECT_NE(ReadError(path_), "accepted") << size << " of " << whole.size();
    }
  }
}

TEST_F(ImageIo, GarbageNeverCrashes) {
  ASSERT_TRUE(WritePng(path_, SlopePicture(61, 37)));
  const std::vector<uint8_t> png = ReadBytes(path_), jpeg = EncodeJpeg(SlopePicture(61, 37));
  std::mt19937 random(1);
  for (int i = 0; i < 300; ++i) {
    std::vector<uint8_t> bytes = i % 2 ? png : jpeg;
    for (size_t changes = 1 + random() % 40; changes > 0; --changes) {
      bytes[8 + random() % (bytes.size() - 8)] = static_cast<uint8_t>(random());
    }
    WriteBytes(path_, bytes);
    const auto read = ReadGrayImage(path_);
    if (!read) {
      EXPECT_THAT(read.error().message, HasSubstr(path_));
    }
  }
}

TEST_F(ImageIo, HugePicturesAreRefusedBeforeTheirMemoryIsTaken) {
  ASSERT_TRUE(WritePng(path_, SlopePicture(8, 8)));
  std::vector<uint8_t> png = ReadBytes(path_);
  // Width 2^24 in the header, which begins behind the signature (8 bytes), length and type; its checksum
  // follows.
  png[16] = 1;
  const auto crc = [](const uint8_t* at, size_t size) {
    uint32_t value = 0xffffffff;
    for (size_t i = 0; i < size; ++i) {
      value ^= at[i];
      for (int bit = 0; bit < 8; ++bit) value = value >> 1 ^ (value & 1 ? 0xedb88320u : 0u);
    }
    return ~value;
  };
  const uint32_t checksum = crc(png.data() + 12, 17);
  for (size_t i = 0; i < 4; ++i) png[29 + i] = static_cast<uint8_t>(checksum >> (24 - 8 * i));
  WriteBytes(path_, png);
  EXPECT_NE(ReadError(path_), "accepted");

  std::vector<uint8_t> jpeg = EncodeJpeg(SlopePicture(64, 48));
  const std::vector<uint8_t> size = {0x00, 48, 0x00, 64};
  const auto at = std::search(jpeg.begin(), jpeg.end(), size.begin(), size.end());
  ASSERT_NE(at, jpeg.end());
  at[0] = at[2] = 0xf0;
  WriteBytes(path_, jpeg);
  EXPECT_THAT(ReadError(path_), HasSubstr("at most 8192 px"));
}

TEST_F(ImageIo, WhatCanNotBeWrittenIsNamed) {
  const auto nowhere = WritePng(folder_ / "no/such/folder.png", SlopePicture(8, 8));
  ASSERT_FALSE(nowhere);
  EXPECT_THAT(nowhere.error().message, AllOf(HasSubstr("no/such/folder.png"), HasSubstr("No such file")));
  EXPECT_FALSE(WritePng(path_, cv::Mat()));
  EXPECT_FALSE(WritePng(path_, cv::Mat(4, 4, CV_32FC1)));
  EXPECT_FALSE(std::filesystem::exists(path_));
  const auto full = WritePng("/dev/full", SlopePicture(400, 400));
  ASSERT_FALSE(full);
  EXPECT_THAT(full.error().message, HasSubstr("can't be written"));
}

}  // namespace
}  // namespace taclink

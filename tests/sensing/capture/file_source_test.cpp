#include "sensing/capture/file_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "sensing/capture/decode.h"
#include "sensing/capture/image_io.h"
#include "tests/sensing/capture/pictures.h"
#include "tests/support/times.h"

namespace taclink {
namespace {

using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::HasSubstr;

class FakeClock final : public Clock {
 public:
  int64_t MonotonicNs() const override { return now_ns_; }
  int64_t UtcNs() const override { return now_ns_ + kUtcOffsetNs; }
  void SleepUntilMonotonicNs(int64_t time_ns) override { now_ns_ = std::max(now_ns_, time_ns); }
  void AdvanceMs(int64_t ms) { now_ns_ += ms * kMs; }

  static constexpr int64_t kUtcOffsetNs = 1'700'000'000'000'000'000;

 private:
  int64_t now_ns_ = 5'000 * kMs;
};

class FileSourceTest : public ::testing::Test {
 protected:
  void Write(const std::string& name, int seed, int width_px = 32) {
    ASSERT_TRUE(WritePng(folder_ / name, SlopePicture(width_px, 24, seed)));
  }
  void WritePairs(int count) {
    for (int i = 1; i <= count; ++i) {
      Write("top_00000" + std::to_string(i) + ".png", i);
      Write("bottom_00000" + std::to_string(i) + ".png", 100 + i);
    }
  }
  /// At 10 a second.
  std::unique_ptr<FrameSource> Source(bool loop, bool paced) {
    return MakeFileSource({.folder = folder_.path(), .frame_rate_hz = 10, .loop = loop, .paced = paced},
                          clock_);
  }
  ErrorCode NextError(FrameSource& source, int timeout_ms = 1000) {
    const auto got = source.Next(frame_, milliseconds(timeout_ms));
    return got ? ErrorCode::kInternal : got.error().code;
  }
  Error StartError() {
    const auto started = Source(true, true)->Start();
    return started ? Error{ErrorCode::kInternal, "it started"} : started.error();
  }
  int Seed(CameraId id) const { return frame_.images[Index(id)].bytes.at(0); }

  TemporaryFolder folder_;
  FakeClock clock_;
  StereoFrame frame_;
};

TEST_F(FileSourceTest, PicturesInMemoryOutliveTheirFiles) {
  WritePairs(2);
  const auto source = MakeFileSource({.folder = folder_.path(), .paced = false, .in_memory = true}, clock_);
  ASSERT_TRUE(source->Start().ok());
  std::filesystem::remove_all(folder_.path());
  for (const int expected : {1, 2, 1}) {
    ASSERT_TRUE(source->Next(frame_, milliseconds(0)).ok());
    EXPECT_EQ(Seed(CameraId::kTop), expected);
    EXPECT_EQ(Seed(CameraId::kBottom), 100 + expected);
  }
}

TEST_F(FileSourceTest, GrayPicturesComeAsYuyvIfAsked) {
  WritePairs(1);
  for (const bool in_memory : {false, true}) {
    const auto source = MakeFileSource(
        {.folder = folder_.path(), .paced = false, .in_memory = in_memory, .yuyv = true}, clock_);
    ASSERT_TRUE(source->Start().ok());
    ASSERT_TRUE(source->Next(frame_, milliseconds(0)).ok());
    const RawImage& image = frame_.images[0];
    EXPECT_EQ(image.format, PixelFormat::kYuyv);
    ASSERT_EQ(image.bytes.size(), 2u * 32 * 24);
    EXPECT_EQ(image.bytes[0], 1);
    EXPECT_EQ(image.bytes[1], 128);
  }
}

TEST_F(FileSourceTest, GivesPairsInTheOrderOfTheirNumbers) {
  // As text, 10 comes before 9; digits need not be as many.
  for (const int number : {10, 9, 100}) {
    Write("top_" + std::to_string(number) + ".png", number);
    Write("bottom_000" + std::to_string(number) + ".png", 100 + number);
  }
  WriteBytes(folder_ / "truth.json", {'{', '}'});
  WriteBytes(folder_ / "top_1.txt", {'x'});
  const auto source = Source(false, false);
  const auto started = source->Start();
  ASSERT_TRUE(started) << started.error().message;
  EXPECT_EQ(source->Info().width_px, 32);
  EXPECT_EQ(source->Info().height_px, 24);
  EXPECT_THAT(source->Info().description, HasSubstr("3 pairs"));
  uint64_t sequence = 0;
  for (const int number : {9, 10, 100}) {
    const auto got = source->Next(frame_, milliseconds(0));
    ASSERT_TRUE(got) << got.error().message;
    EXPECT_EQ(frame_.sequence, sequence++);
    EXPECT_EQ(Seed(CameraId::kTop), number);
    EXPECT_EQ(Seed(CameraId::kBottom), 100 + number);
  }
  EXPECT_EQ(NextError(*source), ErrorCode::kEndOfData);
  EXPECT_EQ(NextError(*source), ErrorCode::kEndOfData);
}

TEST_F(FileSourceTest, JpegStaysAsItIs) {
  const std::vector<uint8_t> jpeg = EncodeJpeg(SlopePicture(32, 24));
  WriteBytes(folder_ / "top_1.JPG", jpeg);
  WriteBytes(folder_ / "bottom_1.jpeg", jpeg);
  const auto source = Source(true, false);
  ASSERT_TRUE(source->Start());
  ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
  for (const RawImage& image : frame_.images) {
    EXPECT_EQ(image.format, PixelFormat::kMjpeg);
    EXPECT_EQ(image.bytes, jpeg);
    EXPECT_EQ(image.width_px, 32);
    EXPECT_TRUE(image.valid);
  }
}

TEST_F(FileSourceTest, AMissingPictureIsNotValid) {
  WritePairs(3);
  std::filesystem::remove(folder_ / "bottom_000002.png");
  const auto source = Source(false, false);
  ASSERT_TRUE(source->Start());
  for (const bool whole : {true, false, true}) {
    ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
    EXPECT_TRUE(frame_.images[Index(CameraId::kTop)].valid);
    EXPECT_EQ(frame_.images[Index(CameraId::kBottom)].valid, whole);
  }
  EXPECT_EQ(source->Counters().unpaired[Index(CameraId::kTop)], 1u);
}

TEST_F(FileSourceTest, ADamagedPictureIsSkippedAndTold) {
  for (const bool in_memory : {false, true}) {
    WritePairs(3);
    const auto source = MakeFileSource(
        {.folder = folder_.path(), .loop = false, .paced = false, .in_memory = in_memory}, clock_);
    WriteBytes(folder_ / "top_000001.png", {'x'});
    if (in_memory) WriteBytes(folder_ / "bottom_000003.png", {'x'});
    ASSERT_TRUE(source->Start());
    if (!in_memory) WriteBytes(folder_ / "bottom_000003.png", {'x'});  // while it plays
    for (const int pair : {1, 2, 3}) {
      ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
      const RawImage &top = frame_.images[Index(CameraId::kTop)],
                     &bottom = frame_.images[Index(CameraId::kBottom)];
      EXPECT_EQ(top.valid, pair != 1);
      EXPECT_EQ(bottom.valid, pair != 3);
      EXPECT_EQ(top.why_missing.empty(), top.valid);
      EXPECT_THAT(bottom.why_missing,
                  HasSubstr(bottom.valid ? "" : "bottom_000003.png: is not a PNG or JPEG"));
      EXPECT_EQ(bottom.valid ? Seed(CameraId::kBottom) : 100 + pair, 100 + pair);
    }
    EXPECT_EQ(NextError(*source), ErrorCode::kEndOfData);
    EXPECT_EQ(source->Counters().damaged[Index(CameraId::kTop)], 1u);
    EXPECT_EQ(source->Counters().damaged[Index(CameraId::kBottom)], 1u);
  }
}

TEST_F(FileSourceTest, AFolderThatIsGoneIsToBeStartedAgain) {
  WritePairs(2);
  const auto source = Source(true, false);
  ASSERT_TRUE(source->Start());
  std::filesystem::rename(folder_.path(), folder_.path() + ".away");
  EXPECT_EQ(NextError(*source), ErrorCode::kUnavailable);
  std::filesystem::rename(folder_.path() + ".away", folder_.path());
  EXPECT_TRUE(source->Next(frame_, milliseconds(0)));
}

TEST_F(FileSourceTest, BeginsAgainWhenAsked) {
  WritePairs(2);
  const auto source = Source(true, false);
  ASSERT_TRUE(source->Start());
  for (uint64_t i = 0; i < 5; ++i) {
    ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
    EXPECT_EQ(frame_.sequence, i);
    EXPECT_EQ(Seed(CameraId::kTop), 1 + static_cast<int>(i % 2));
  }
}

TEST_F(FileSourceTest, KeepsTheFrameRate) {
  WritePairs(3);
  const auto source = Source(true, true);
  ASSERT_TRUE(source->Start());
  const int64_t start_ns = clock_.MonotonicNs();
  for (int i = 0; i < 7; ++i) {
    ASSERT_TRUE(source->Next(frame_, milliseconds(1000)));
    EXPECT_EQ(frame_.times.exposure_monotonic_ns, start_ns + i * 100 * kMs);
    EXPECT_EQ(frame_.times.exposure_utc_ns, frame_.times.exposure_monotonic_ns + FakeClock::kUtcOffsetNs);
    EXPECT_EQ(frame_.times.received_ns, clock_.MonotonicNs());
    EXPECT_EQ(frame_.times.tracked_ns, 0);
    clock_.AdvanceMs(30);
  }
}

TEST_F(FileSourceTest, BeginsSoLongAfterAFullSecond) {
  WritePairs(2);
  const auto source =
      MakeFileSource({.folder = folder_.path(), .frame_rate_hz = 10, .start_after_s = 0.3}, clock_);
  clock_.AdvanceMs(123);
  ASSERT_TRUE(source->Start());
  const int64_t first_ns = (clock_.MonotonicNs() / (1000 * kMs) + 1) * 1000 * kMs + 300 * kMs;
  ASSERT_TRUE(source->Next(frame_, milliseconds(3000)));
  EXPECT_EQ(frame_.times.exposure_monotonic_ns, first_ns);
  ASSERT_TRUE(source->Next(frame_, milliseconds(3000)));
  EXPECT_EQ(frame_.times.exposure_monotonic_ns, first_ns + 100 * kMs);
}

TEST_F(FileSourceTest, WaitsNoLongerThanItsTimeout) {
  WritePairs(2);
  const auto source = Source(true, true);
  ASSERT_TRUE(source->Start());
  ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
  const int64_t before_ns = clock_.MonotonicNs();
  EXPECT_EQ(NextError(*source, 60), ErrorCode::kTimeout);
  EXPECT_EQ(clock_.MonotonicNs(), before_ns + 60 * kMs);
  ASSERT_TRUE(source->Next(frame_, milliseconds(60)));
  EXPECT_EQ(clock_.MonotonicNs(), before_ns + 100 * kMs);
  EXPECT_EQ(frame_.sequence, 1u);
}

TEST_F(FileSourceTest, ALateCallerGetsTheNewestPair) {
  WritePairs(3);
  const auto source = Source(true, true);
  ASSERT_TRUE(source->Start());
  ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
  clock_.AdvanceMs(450);
  ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
  EXPECT_EQ(frame_.sequence, 4u);
  EXPECT_EQ(Seed(CameraId::kTop), 2);
  EXPECT_EQ(source->Counters().skipped_pairs, 3u);
}

TEST_F(FileSourceTest, ALateCallerStillGetsTheLastPairOfAFiniteFolder) {
  WritePairs(3);
  const auto source = Source(false, true);
  ASSERT_TRUE(source->Start());
  clock_.AdvanceMs(60'000);
  ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
  EXPECT_EQ(frame_.sequence, 2u);
  EXPECT_EQ(NextError(*source), ErrorCode::kEndOfData);
}

TEST_F(FileSourceTest, SequenceRisesOverANewStart) {
  WritePairs(2);
  const auto source = Source(false, false);
  for (uint64_t i = 0; i < 4; ++i) {
    if (i % 2 == 0) {
      ASSERT_TRUE(source->Start());
    }
    ASSERT_TRUE(source->Next(frame_, milliseconds(0)));
    EXPECT_EQ(frame_.sequence, i);
  }
}

TEST_F(FileSourceTest, BadFoldersAreNamedWithWhatIsExpected) {
  EXPECT_EQ(StartError().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(StartError().message, AllOf(HasSubstr(folder_.path()), HasSubstr("top_000001.png")));
  const auto missing = MakeFileSource({.folder = folder_ / "none"}, clock_)->Start();
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(missing.error().message, AllOf(HasSubstr(folder_ / "none"), HasSubstr("top_000001.png")));
}

TEST_F(FileSourceTest, BadPicturesAreNamed) {
  WritePairs(2);
  Write("top_3.png", 0, 48);
  EXPECT_THAT(StartError().message, AllOf(HasSubstr("top_3.png: is 48x24"), HasSubstr("32x24")));
  std::filesystem::remove(folder_ / "top_3.png");
  for (const char* name : {"top_000001.png", "bottom_000001.png", "top_000002.png", "bottom_000002.png"})
    WriteBytes(folder_ / name, {'x'});
  EXPECT_THAT(StartError().message, AllOf(HasSubstr("top_000001.png"), HasSubstr("not a PNG or JPEG")));
  Write("top_01.png", 0);
  EXPECT_THAT(StartError().message, HasSubstr("two pictures with number 1 for the top camera"));
}

TEST_F(FileSourceTest, NextBeforeStartAsksForStart) {
  EXPECT_EQ(NextError(*Source(true, true)), ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace taclink

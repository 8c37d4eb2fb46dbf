// Pictures of logs that the recorder made, asked for over the API.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "client/cpp/taclink/recordings.h"
#include "sensing/capture/decode.h"
#include "taclink/v1/recording.grpc.pb.h"
#include "tests/integration/support.h"
#include "tests/support/times.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Twenty frames of "upper" with pictures whose grey is 10 times their number, every second one without the
/// bottom one.
class ReplayPicturesTest : public ::testing::Test {
 protected:
  std::string Record(bool pictures) {
    server_.arm().Start();
    v1::StartRecordingRequest request;
    request.set_pictures(pictures);
    EXPECT_TRUE(recordings_.Start(request).ok());
    const auto published = Stream(client_, Every());
    const int64_t begin_ns = server_.clock().MonotonicNs();
    for (uint64_t i = 1; i <= 20; ++i) {
      server_.clock().Advance(milliseconds(10));
      const int64_t now_ns = server_.clock().MonotonicNs(), utc_ns = server_.clock().UtcNs();
      begin_utc_ns_ = utc_ns - (now_ns - begin_ns);
      server_.script(0).Push([=](StereoFrame& frame) -> Result<void> {
        frame.sequence = i;
        frame.times = {.exposure_monotonic_ns = now_ns, .exposure_utc_ns = utc_ns, .received_ns = now_ns};
        for (RawImage& image : frame.images) {
          image = {.format = PixelFormat::kGray8, .width_px = 16, .height_px = 16, .bytes = {}};
          image.bytes.assign(256, static_cast<uint8_t>(10 * i));
          image.valid = true;
        }
        frame.images[1].valid = i % 2 == 1;
        return {};
      });
      // A worker that is busy passes over all frames but the newest.
      for (v1::LinkFrame frame; !HasFailure() && (frame.link() != "upper" || frame.sequence() < i);)
        frame = NextOf(*published);
    }
    server_.arm().Stop();
    return recordings_.Stop()->log();
  }
  ~ReplayPicturesTest() override {
    context_.TryCancel();
    v1::ReplayResponse rest;
    while (call_ && call_->Read(&rest)) {
    }
    fs::remove_all(folder_);
  }
  void Open(const std::string& log) {
    v1::ReplayRequest request;
    request.set_log(log);
    request.set_paused(true);
    call_ = stub_->Replay(&context_, request);
    v1::ReplayResponse first;
    ASSERT_TRUE(call_->Read(&first));
    player_ = first.status().player();
  }
  grpc::StatusCode Ask(const std::string& link, int64_t after_begin_ms) {
    v1::GetReplayPicturesRequest request;
    request.set_player(player_);
    request.set_link(link);
    request.set_utc_ns(begin_utc_ns_ + after_begin_ms * kMs);
    grpc::ClientContext context;
    answer_.Clear();
    return stub_->GetReplayPictures(&context, request, &answer_).error_code();
  }
  int GreyOf(int camera) {
    const std::string& jpeg = answer_.pictures(camera).jpeg();
    RawImage image{
        .format = PixelFormat::kMjpeg, .width_px = 16, .height_px = 16, .bytes = {jpeg.begin(), jpeg.end()}};
    image.valid = true;
    cv::Mat gray;
    EXPECT_TRUE(GrayDecoder().Decode(image, gray).ok());
    return gray.empty() ? -1 : gray.at<uint8_t>(8, 8);
  }

  const std::string folder_ = ::testing::TempDir() + "replay_pictures." + std::to_string(::getpid());
  TestServer server_{TestLimits(), nullptr, {}, {.folder = folder_}};
  client::Client client_ = server_.Connect();
  client::Recordings recordings_ = client_.RecordingCalls();
  std::unique_ptr<v1::RecordingService::Stub> stub_ =
      v1::RecordingService::NewStub(server_.server().InProcessChannel());
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::ReplayResponse>> call_;
  std::string player_;
  int64_t begin_utc_ns_ = 0;
  v1::GetReplayPicturesResponse answer_;
};

TEST_F(ReplayPicturesTest, AreThoseOfTheMoment) {
  Open(Record(true));
  ASSERT_EQ(Ask("upper", 75), grpc::StatusCode::OK);
  EXPECT_EQ(answer_.sequence(), 7u);
  EXPECT_EQ(answer_.exposure_utc_ns(), begin_utc_ns_ + 70 * kMs);
  ASSERT_EQ(answer_.pictures_size(), 2);
  EXPECT_EQ(answer_.pictures(0).camera(), "top");
  EXPECT_NEAR(GreyOf(0), 70, 2);
  EXPECT_NEAR(GreyOf(1), 70, 2);
  ASSERT_EQ(Ask("upper", 85), grpc::StatusCode::OK);
  EXPECT_NEAR(GreyOf(0), 80, 2);
  EXPECT_THAT(answer_.pictures(1).jpeg(), IsEmpty()) << "not that of another frame";
  EXPECT_THAT(answer_.pictures(1).why_missing(), HasSubstr("no picture"));
  EXPECT_EQ(Ask("upper", 5), grpc::StatusCode::FAILED_PRECONDITION) << "before the first";
  EXPECT_EQ(Ask("upper", 2300), grpc::StatusCode::FAILED_PRECONDITION) << "the last is too old";
  EXPECT_EQ(Ask("elbow", 75), grpc::StatusCode::NOT_FOUND);
  player_ = "0123";
  EXPECT_EQ(Ask("upper", 75), grpc::StatusCode::NOT_FOUND);
}

TEST_F(ReplayPicturesTest, ALogWithoutSaysSo) {
  Open(Record(false));
  EXPECT_EQ(Ask("upper", 100), grpc::StatusCode::FAILED_PRECONDITION);
}

}  // namespace
}  // namespace taclink::server

// Runs as root in the machine of run-in-vm with vhci_hcd and uvcvideo: a server with emulated cameras under
// the kernel's own driver. Cameras, unplugging and the server around them are tested here; markers and forces
// are not. Prints the table of docs/faults.md.
#include "tests/v4l2/rig.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "sensing/capture/camera_finder.h"
#include "sensing/capture/decode.h"
#include "sensing/capture/v4l2_device.h"
#include "sensing/capture/v4l2_source.h"
#include "sensing/core/clock.h"
#include "taclink/v1/tactile.grpc.pb.h"
#include "tests/sensing/capture/pictures.h"
#include "tests/support/paths.h"
#include "tests/support/process.h"

namespace taclink::testing {
namespace {

using ::testing::HasSubstr;

// From a fault to the status, and from its end to `ok`, in frames of the other link, which runs on: frames
// count the guest's time, however slowly the host computes it.
constexpr size_t kToStatusFrames = 5 * kRigRateHz, kToRecoveryFrames = 8 * kRigRateHz;
constexpr double kStartS = 10;  // of the guest
enum : size_t { kATop, kABottom, kBTop, kBBottom };

bool Blames(const v1::LinkFrame& frame, const std::string& reason) {
  return frame.status() != v1::LINK_STATUS_OK && frame.status_reason().find(reason) != std::string::npos;
}
bool IsOk(const v1::LinkFrame& frame) {
  return frame.status() == v1::LINK_STATUS_OK;
}
bool NamesNoCamera(const v1::LinkFrame& frame) {
  return frame.times().exposure_ns() != 0 && frame.status_reason().find("camera") == std::string::npos;
}
double Seconds(int64_t from_ns, int64_t to_ns) {
  return 1e-9 * static_cast<double>(to_ns - from_ns);
}
int LostBetween(const std::vector<ReceivedFrame>& frames) {
  int lost = 0;
  for (size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].frame.sequence() > frames[i - 1].frame.sequence() + 1)
      lost += static_cast<int>(frames[i].frame.sequence() - frames[i - 1].frame.sequence() - 1);
  }
  return lost;
}

struct Fault {
  const char* what;
  const char* how;
  const char* reason;  ///< part of what the status says
  std::function<void(Rig&)> inject, undo;
};

/// For the kernel to find what was plugged in: nothing tells of it.
void LetTimePass() {
  poll(nullptr, 0, 10);
}

std::optional<V4l2Device> HoldOpen(const std::string& name, int seconds) {
  V4l2DeviceOptions options;
  options.frame_rate_hz = kRigRateHz;
  options.format = PixelFormat::kMjpeg;
  for (const int64_t until = MonotonicNs() + seconds * int64_t{1'000'000'000}; MonotonicNs() < until;) {
    const auto node = FindCamera(name);
    if (!node) {
      LetTimePass();
      continue;
    }
    options.path = *node;
    auto device = V4l2Device::Open(options);
    if (device) return std::move(*device);
  }
  return std::nullopt;
}

class RigTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    rig_ = new Rig();
    std::printf(
        "| Fault | Injected by | Status | To status, s | To recovery, s | Lost on the other link |\n"
        "|---|---|---|---|---|---|\n");
  }
  static void TearDownTestSuite() { delete rig_; }

  static void PrintRow(const char* what, const char* how, const v1::LinkFrame& frame, double to_status_s,
                       double to_recovery_s, const std::string& lost) {
    std::string reason = frame.status_reason();  // without the list of cameras
    for (size_t at = 0; (at = reason.find(" There are")) != std::string::npos;)
      reason.erase(at, std::min(reason.find(';', at), reason.size()) - at);
    std::printf("| %s | %s | %s: %s | %.2f | %.2f | %s |\n", what, how, client::Name(frame.status()),
                reason.c_str(), to_status_s, to_recovery_s, lost.c_str());
    std::fflush(stdout);
  }

  static void Run(const Fault& fault) {
    const int64_t injected_ns = MonotonicNs();
    fault.inject(*rig_);
    const auto noticed =
        rig_->Await("a", injected_ns, [&](const auto& frame) { return Blames(frame, fault.reason); });
    ASSERT_TRUE(noticed) << fault.what;
    const int64_t undone_ns = MonotonicNs();
    fault.undo(*rig_);
    const auto recovered = rig_->Await("a", undone_ns, IsOk);
    ASSERT_TRUE(recovered) << fault.what;
    const auto others = rig_->Frames("b", injected_ns, recovered->received_ns);
    const double to_status_s = Seconds(injected_ns, noticed->received_ns);
    const double to_recovery_s = Seconds(undone_ns, recovered->received_ns);
    const int lost = LostBetween(others);
    PrintRow(fault.what, fault.how, noticed->frame, to_status_s, to_recovery_s,
             std::to_string(lost) + " of " + std::to_string(others.size() + static_cast<size_t>(lost)));
    EXPECT_LE(rig_->Frames("b", injected_ns, noticed->received_ns).size(), kToStatusFrames) << fault.what;
    EXPECT_LE(rig_->Frames("b", undone_ns, recovered->received_ns).size(), kToRecoveryFrames) << fault.what;
    EXPECT_EQ(lost, 0) << fault.what;
    EXPECT_FALSE(others.empty()) << fault.what;
    for (const ReceivedFrame& other : others)
      EXPECT_TRUE(IsOk(other.frame)) << fault.what << ": " << other.frame.status_reason();
  }

  static Rig* rig_;
};
Rig* RigTest::rig_ = nullptr;

// Link a's bottom camera is held by another program, link b's is not there yet; both links say so and begin
// as soon as they can.
TEST_F(RigTest, AStartsWithoutCameras) {
  for (const size_t number : {kATop, kABottom, kBTop})
    ASSERT_EQ(rig_->camera(number).Plug(static_cast<int>(number)), "");
  auto held = HoldOpen("serial:a-bottom", 60);
  ASSERT_TRUE(held);
  for (const char* name : {"serial:a-top", "serial:b-top"}) {
    while (!FindCamera(name)) LetTimePass();
  }
  ASSERT_EQ(rig_->StartServer(), "");
  const int64_t started_ns = MonotonicNs();
  const auto busy = rig_->Await("a", 0, [](const auto& frame) { return Blames(frame, "another program"); });
  const auto absent =
      rig_->Await("b", 0, [](const auto& frame) { return Blames(frame, "serial:b-bottom: no such camera"); });
  ASSERT_TRUE(busy && absent);
  EXPECT_THAT(busy->frame.status_reason(), HasSubstr("bottom camera"));

  const int64_t released_ns = MonotonicNs();
  held.reset();
  ASSERT_EQ(rig_->camera(kBBottom).Plug(kBBottom), "");
  const auto a = rig_->Await("a", released_ns, NamesNoCamera);
  const auto b = rig_->Await("b", released_ns, NamesNoCamera);
  ASSERT_TRUE(a && b);
  // Recovery is the first pair's exposure.
  PrintRow("Held by another program at the start", "another process has it open with buffers", busy->frame,
           Seconds(started_ns, busy->received_ns), Seconds(released_ns, a->frame.times().exposure_ns()), "-");
  PrintRow("Absent at the start", "not plugged in", absent->frame, Seconds(started_ns, absent->received_ns),
           Seconds(released_ns, b->frame.times().exposure_ns()), "-");
  EXPECT_LE(Seconds(started_ns, busy->received_ns), kStartS);
  EXPECT_LE(Seconds(started_ns, absent->received_ns), kStartS);
  EXPECT_LE(Seconds(released_ns, a->frame.times().exposure_ns()), kStartS);
  EXPECT_LE(Seconds(released_ns, b->frame.times().exposure_ns()), kStartS);
  for (const char* link : {"a", "b"})
    ASSERT_TRUE(rig_->Await(link, released_ns, IsOk))
        << rig_->Frames(link, 0, MonotonicNs()).back().frame.status_reason();
}

TEST_F(RigTest, BNoFrameIsLost) {
  constexpr size_t kFrames = 4 * kRigRateHz;
  const int64_t begun_ns = MonotonicNs();
  for (const char* link : {"a", "b"}) {
    ASSERT_TRUE(rig_->Await(link, begun_ns,
                            [&, seen = size_t{0}](const auto&) mutable { return ++seen == kFrames; }));
    const auto frames = rig_->Frames(link, begun_ns, MonotonicNs());
    EXPECT_EQ(LostBetween(frames), 0) << link;
    for (const ReceivedFrame& each : frames) EXPECT_TRUE(IsOk(each.frame)) << each.frame.status_reason();
  }
}

TEST_F(RigTest, BPreviewsAreWhatTheCamerasSee) {
  const auto stub =
      v1::TactileService::NewStub(grpc::CreateChannel(rig_->address(), grpc::InsecureChannelCredentials()));
  for (const char* link : {"a", "b"}) {  // MJPEG as it came, and made of YUYV
    grpc::ClientContext context;
    v1::StreamPreviewRequest request;
    request.set_link(link);
    const auto reader = stub->StreamPreview(&context, request);
    v1::StreamPreviewResponse preview;
    ASSERT_TRUE(reader->Read(&preview));
    context.TryCancel();
    ASSERT_EQ(preview.pictures_size(), 2);
    for (const CameraId id : kBothCameras) {
      const v1::PreviewPicture& picture = preview.pictures(static_cast<int>(Index(id)));
      ASSERT_EQ(picture.width_px(), static_cast<uint32_t>(kRigWidthPx)) << picture.why_missing();
      ASSERT_EQ(picture.height_px(), static_cast<uint32_t>(kRigHeightPx));
      RawImage jpeg{.format = PixelFormat::kMjpeg,
                    .width_px = kRigWidthPx,
                    .height_px = kRigHeightPx,
                    .bytes = {picture.jpeg().begin(), picture.jpeg().end()}};
      jpeg.valid = true;
      cv::Mat gray;
      ASSERT_TRUE(GrayDecoder().Decode(jpeg, gray).ok());
      for (const CameraId other : kBothCameras) {
        int nearest = 255;
        for (const cv::Mat& shown : rig_->pictures(other).gray())
          nearest = std::min(nearest, LargestDifference(gray, shown));
        EXPECT_EQ(nearest <= 12, other == id)
            << "link " << link << ", " << Name(id) << " camera: " << nearest;
      }
    }
  }
}

TEST_F(RigTest, BSettingsGoToTheCameraAlsoWhenItComesBack) {
  constexpr UvcSettings kManual{.exposure_mode = 1, .exposure_100us = 80, .gain = 20};
  client::Client& client = rig_->client();
  const auto bottom = [] { return rig_->Arm().links(0).cameras(1); };
  EXPECT_TRUE(bottom().automatic_exposure());
  EXPECT_FALSE(bottom().has_exposure_s());
  EXPECT_EQ(bottom().gain(), 16);
  v1::SetCameraRequest manual;
  manual.set_link("a");
  manual.set_camera("bottom");
  manual.set_exposure_s(0.008);
  manual.set_gain(20);
  const auto set = client.SetCamera(manual);
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_EQ(rig_->camera(kABottom).settings(), kManual);
  EXPECT_EQ(rig_->camera(kATop).settings(), UvcSettings());
  const auto read_back = [&](const v1::Camera& camera) {
    return camera.has_automatic_exposure() && !camera.automatic_exposure() && camera.exposure_s() == 0.008 &&
           camera.gain() == 20;
  };
  EXPECT_TRUE(read_back(bottom()));

  v1::SetCameraRequest gain;
  gain.set_link("a");
  gain.set_camera("bottom");
  gain.set_gain(900);
  const auto refused = client.SetCamera(gain);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(refused.error().message, HasSubstr("gain must be from 0 to 64, not 900"));

  const int64_t unplugged_ns = MonotonicNs();
  rig_->camera(kABottom).Unplug();
  ASSERT_TRUE(
      rig_->Await("a", unplugged_ns, [](const auto& frame) { return Blames(frame, "bottom camera"); }));
  EXPECT_FALSE(bottom().has_gain()) << "nobody knows";
  gain.set_gain(3);
  EXPECT_EQ(client.SetCamera(gain).error().code, ErrorCode::kUnavailable);
  const int64_t plugged_ns = MonotonicNs();
  ASSERT_EQ(rig_->camera(kABottom).Plug(kABottom), "");
  ASSERT_TRUE(rig_->Await("a", plugged_ns, IsOk));
  EXPECT_EQ(rig_->camera(kABottom).settings(), kManual);
  EXPECT_TRUE(read_back(bottom()));

  v1::SetCameraRequest automatic;
  automatic.set_link("a");
  automatic.set_camera("bottom");
  automatic.set_automatic(true);
  ASSERT_TRUE(client.SetCamera(automatic));
  EXPECT_EQ(rig_->camera(kABottom).settings().exposure_mode, 8u);
  EXPECT_TRUE(bottom().automatic_exposure());
}

TEST_F(RigTest, CFaultsOfOneLinkAreSaidMendedAndNobodyElses) {
  const auto nothing = [](Rig&) {};
  Run({"One camera unplugged, plugged into another port", "USB/IP port closed, another one opened",
       "bottom camera", [](Rig& rig) { rig.camera(kABottom).Unplug(); },
       [](Rig& rig) { EXPECT_EQ(rig.camera(kABottom).Plug(5), ""); }});
  Run({"Both cameras unplugged", "both USB/IP ports closed", "top camera",
       [](Rig& rig) {
         rig.camera(kATop).Unplug();
         rig.camera(kABottom).Unplug();
       },
       [](Rig& rig) {
         EXPECT_EQ(rig.camera(kATop).Plug(0), "");
         EXPECT_EQ(rig.camera(kABottom).Plug(1), "");
       }});
  Run({"One camera stalled", "it answers, but sends no pictures", "serial:a-bottom",
       [](Rig& rig) { rig.camera(kABottom).Stall(true); },
       [](Rig& rig) { rig.camera(kABottom).Stall(false); }});
  Run({"Both cameras stalled", "they answer, but send no pictures", "no pair of pictures",
       [](Rig& rig) {
         rig.camera(kATop).Stall(true);
         rig.camera(kABottom).Stall(true);
       },
       [](Rig& rig) {
         rig.camera(kATop).Stall(false);
         rig.camera(kABottom).Stall(false);
       }});
  Run({"Corrupt pictures", "a quarter of the JPEG's bytes overwritten, 4 pictures", "top camera",
       [](Rig& rig) { rig.camera(kATop).Spoil(Damage::kCorrupt, 4); }, nothing});
  Run({"Short pictures", "the second half missing, 4 pictures", "top camera",
       [](Rig& rig) { rig.camera(kATop).Spoil(Damage::kShort, 4); }, nothing});
  Run({"Pictures with the error bit", "UVC's error bit, until lifted", "serial:a-top",
       [](Rig& rig) { rig.camera(kATop).Spoil(Damage::kErrorBit, 1000); },
       [](Rig& rig) { rig.camera(kATop).Spoil(Damage::kNone, 0); }});
}

TEST_F(RigTest, DWhatHappenedIsCounted) {
  const v1::Arm arm = rig_->Arm();
  ASSERT_EQ(arm.links_size(), 2);
  ASSERT_EQ(arm.links(0).cameras_size(), 2);
  const v1::Camera& top = arm.links(0).cameras(0);
  const v1::Camera& bottom = arm.links(0).cameras(1);
  EXPECT_EQ(top.format(), "MJPEG 320x240");
  EXPECT_EQ(arm.links(1).cameras(0).format(), "YUYV 320x240");
  EXPECT_THAT(top.device(), HasSubstr("serial:a-top"));
  EXPECT_THAT(bottom.device(), HasSubstr("usb:"));
  EXPECT_EQ(bottom.trouble(), "");
  EXPECT_NEAR(top.rate_hz(), kRigRateHz, 0.1 * kRigRateHz);
  EXPECT_GE(top.undecodable(), 2u);  // of eight: what came while a frame computed was left out
  EXPECT_GT(top.unpaired() + bottom.unpaired() + top.pictures(), 0u);
}

TEST_F(RigTest, EHundredAndTwentyPairsASecond) {
  rig_->StopServer();
  const std::vector<uint8_t> picture = EncodeJpeg(SlopePicture(320, 240));
  const auto show = [&picture](int64_t, uint8_t) { return std::span<const uint8_t>(picture); };
  EmulatedCamera top("fast-top", show), bottom("fast-bottom", show);
  ASSERT_EQ(top.Plug(6), "");
  ASSERT_EQ(bottom.Plug(7), "");
  for (const char* name : {"serial:fast-top", "serial:fast-bottom"}) {
    while (!FindCamera(name)) LetTimePass();
  }
  const auto source = MakeV4l2Source({.devices = {"serial:fast-top", "serial:fast-bottom"},
                                      .width_px = 320,
                                      .height_px = 240,
                                      .frame_rate_hz = 120,
                                      .format = PixelFormat::kMjpeg},
                                     SystemClock());
  const auto started = source->Start();
  ASSERT_TRUE(started) << started.error().message;
  StereoFrame frame;
  constexpr int kPairs = 240;
  uint64_t first = 0;
  for (int i = 0; i < kPairs; ++i) {
    const auto got = source->Next(frame, std::chrono::seconds(10));
    ASSERT_TRUE(got) << got.error().message;
    EXPECT_TRUE(frame.images[0].valid && frame.images[1].valid);
    if (i == 0) first = frame.sequence;
  }
  const SourceCounters counters = source->Counters();
  std::printf("%d pairs over %llu exposures, %.2f and %.2f pictures a second\n", kPairs,
              static_cast<unsigned long long>(frame.sequence - first + 1), counters.rate_hz[0],
              counters.rate_hz[1]);
  for (const double rate_hz : counters.rate_hz) EXPECT_NEAR(rate_hz, 120, 0.05 * 120);
  EXPECT_LE(frame.sequence - first + 1, kPairs * 1.05);
}

TEST_F(RigTest, FCamerasAreListed) {
  EmulatedCamera camera("listed", [](int64_t, uint8_t) { return std::span<const uint8_t>(); });
  ASSERT_EQ(camera.Plug(7), "");
  while (!FindCamera("serial:listed")) LetTimePass();
  const Finished listed = RunToEnd({kTaclink, "cameras"});
  EXPECT_EQ(listed.exit_code, 0) << listed.err;
  EXPECT_THAT(listed.out, HasSubstr("'Emulated camera' usb:1-8 serial:listed"));
  EXPECT_THAT(listed.out, HasSubstr("MJPG  320x240    120, 60, 30, 5 per second"));
  EXPECT_THAT(listed.out, HasSubstr("YUYV  640x480    30, 15, 10, 5, 4, 3, 2 per second"));
  std::printf("%s", listed.out.c_str());
}

}  // namespace
}  // namespace taclink::testing

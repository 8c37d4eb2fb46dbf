// What people do to a link from the dashboard: look through its cameras, set them, choose its force model.
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include "sensing/capture/decode.h"
#include "sensing/pipeline/state_estimator.h"
#include "taclink/v1/tactile.grpc.pb.h"
#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kWidth = 32, kHeight = 24;

/// Two gray pictures, and markers 5 and 7 found in the first one.
void FillPictures(StereoFrame& frame) {
  for (RawImage& image : frame.images) {
    image = {PixelFormat::kGray8, kWidth, kHeight, std::vector<uint8_t>(kWidth * kHeight, 90), true};
  }
}

LabelledMarkers TwoMarkers() {
  LabelledMarkers labels;
  labels.cameras[0].resize(16 * 16);
  labels.cameras[0][5] = {.seen = true, .center_px = {3.5, 4.5}, .covariance_px2 = 0.04 * Mat2::Identity()};
  labels.cameras[0][7] = {.seen = true, .center_px = {20, 11}};
  return labels;
}

/// Finds two markers; the source takes any setting but a gain of 99.
class LinkCallsTest : public ::testing::Test {
 protected:
  struct Log {
    std::mutex mutex;
    std::vector<std::pair<CameraId, CameraSettings>> set;  // guarded by mutex
    std::vector<std::optional<ForceModel>> made;           // likewise
    std::atomic<int> used = 0;
    std::atomic<bool> refuses = false;
  };

  class Processor final : public LinkProcessor {
   public:
    explicit Processor(std::shared_ptr<Log> log) : log_(std::move(log)) {}
    void Process(const StereoFrame& frame, LinkState& state) override {
      FillTestState(0, frame.sequence, state);
      state.times = frame.times;
    }
    Result<void> BeginCalibration(const CalibrationOrder&) override { return {}; }
    CalibrationProgress PollCalibration() override { return {}; }
    void CancelCalibration() override {}
    const LabelledMarkers* labels() const override { return &labels_; }
    Result<void> UseEstimator(std::shared_ptr<StateEstimator> estimator) override {
      EXPECT_NE(estimator, nullptr);
      if (log_->refuses) return Error{ErrorCode::kFailedPrecondition, "a calibration is under way"};
      ++log_->used;
      log_->used.notify_all();
      return {};
    }

   private:
    const std::shared_ptr<Log> log_;
    const LabelledMarkers labels_ = TwoMarkers();
  };

  class Source final : public FrameSource {
   public:
    Source(std::shared_ptr<SourceScript> script, std::shared_ptr<Log> log)
        : inner_(std::move(script)), log_(std::move(log)) {}
    Result<void> Start() override { return inner_.Start(); }
    Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) override {
      return inner_.Next(frame, timeout);
    }
    SourceInfo Info() const override { return inner_.Info(); }
    Result<void> SetCamera(CameraId id, const CameraSettings& settings) override {
      if (settings.gain == 99) return Error{ErrorCode::kInvalidArgument, "gain must be 0 to 64"};
      const std::lock_guard lock(log_->mutex);
      log_->set.emplace_back(id, settings);
      return {};
    }

   private:
    FakeSource inner_;
    const std::shared_ptr<Log> log_;
  };

  LinkCallsTest() {
    std::vector<LinkParts> links;
    links.push_back({.description = {.name = "upper", .model = *LoadLinkModel("cylinder")},
                     .source = std::make_unique<Source>(script_, log_),
                     .processor = std::make_unique<Processor>(log_),
                     .factories = {.estimator = [log = log_](std::optional<ForceModel> model)
                                       -> Result<std::shared_ptr<StateEstimator>> {
                       const std::lock_guard lock(log->mutex);
                       if (model == ForceModel::kLiteral)
                         return Error{ErrorCode::kFailedPrecondition, "it does not hold"};
                       log->made.push_back(model);
                       return std::shared_ptr<StateEstimator>(
                           MakeStateEstimator(*LoadLinkModel("cylinder"), {.model = model}));
                     }}});
    arm_ = std::make_unique<Arm>("test", std::move(links), MakeEncoder({"upper"}), clock_,
                                 ArmOptions{.worker = {.poll = std::chrono::milliseconds(5)}});
    server_ = std::move(*RpcServer::Start("127.0.0.1:0", *arm_, TestLimits(), nullptr, nullptr));
    arm_->Start();
    stub_ = v1::TactileService::NewStub(
        grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
  }
  ~LinkCallsTest() override { arm_->Stop(); }

  grpc::Status SetCamera(const v1::SetCameraRequest& request) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kForever);
    v1::SetCameraResponse response;
    return stub_->SetCamera(&context, request, &response);
  }
  grpc::Status SetForceModel(const std::string& link, v1::ForceModel model) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kForever);
    v1::SetForceModelRequest request;
    request.set_link(link);
    request.set_model(model);
    v1::SetForceModelResponse response;
    return stub_->SetForceModel(&context, request, &response);
  }
  /// The first event of `kind` since the server started.
  v1::Event FirstEvent(v1::EventKind kind) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kForever);
    v1::StreamEventsRequest wanted;
    wanted.set_after_sequence(0);
    wanted.add_kinds(kind);
    const auto stream = stub_->StreamEvents(&context, wanted);
    v1::StreamEventsResponse message;
    while (stream->Read(&message) && !message.has_event()) {
    }
    context.TryCancel();
    return message.event();
  }
  /// The source runs once it was asked for a frame.
  void WaitUntilRunning() { script_->WaitUntilTaken(); }

  ManualClock clock_;
  const std::shared_ptr<SourceScript> script_ = std::make_shared<SourceScript>();
  const std::shared_ptr<Log> log_ = std::make_shared<Log>();
  std::unique_ptr<Arm> arm_;
  std::unique_ptr<RpcServer> server_;
  std::unique_ptr<v1::TactileService::Stub> stub_;
};

TEST_F(LinkCallsTest, PreviewHasThePicturesAndTheMarkersFoundInThem) {
  grpc::ClientContext context;
  v1::StreamPreviewRequest request;
  request.set_link("upper");
  request.set_max_rate_hz(30);
  const auto stream = stub_->StreamPreview(&context, request);
  v1::StreamPreviewResponse preview;
  // Pictures are kept only for who wants them: until the stream is there, frames bring none.
  std::jthread pusher([this](const std::stop_token& stop) {
    for (uint64_t sequence = 1; !stop.stop_requested(); ++sequence) {
      script_->Push([sequence](StereoFrame& frame) -> Result<void> {
        FillPictures(frame);
        frame.sequence = sequence;
        frame.times.exposure_monotonic_ns = static_cast<int64_t>(sequence);
        return {};
      });
      clock_.Advance(std::chrono::seconds(1));
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  ASSERT_TRUE(stream->Read(&preview));
  context.TryCancel();
  pusher = {};
  EXPECT_EQ(preview.link(), "upper");
  EXPECT_GT(preview.sequence(), 0u);
  ASSERT_EQ(preview.pictures_size(), 2);
  const v1::PreviewPicture& top = preview.pictures(0);
  EXPECT_EQ(top.camera(), "top");
  EXPECT_THAT(top.markers(), ElementsAre(5, 7));
  EXPECT_THAT(top.centers_px(), ElementsAre(3.5F, 4.5F, 20, 11));
  EXPECT_FLOAT_EQ(top.center_sigmas_px(0), 0.2F);
  EXPECT_EQ(preview.pictures(1).markers_size(), 0);
  const auto size = JpegSize({reinterpret_cast<const uint8_t*>(top.jpeg().data()), top.jpeg().size()});
  ASSERT_TRUE(size.ok()) << size.error().message;
  EXPECT_EQ(size->width_px, kWidth);
  EXPECT_EQ(size->height_px, kHeight);
}

TEST_F(LinkCallsTest, PreviewRefusesWhatItCantDo) {
  const auto status = [this](const std::string& link, double rate_hz) {
    grpc::ClientContext context;
    v1::StreamPreviewRequest request;
    request.set_link(link);
    request.set_max_rate_hz(rate_hz);
    const auto stream = stub_->StreamPreview(&context, request);
    v1::StreamPreviewResponse none;
    EXPECT_FALSE(stream->Read(&none));
    return stream->Finish().error_code();
  };
  EXPECT_EQ(status("other", 5), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(status("upper", -1), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status("upper", 31), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(LinkCallsTest, TheHistoryHasTheFramesOfBefore) {
  constexpr int64_t kBegin = 1'700'000'000'000'000'000;
  v1::GetForceHistoryRequest request;
  v1::GetForceHistoryResponse history;
  const auto ask = [&] {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kForever);
    return stub_->GetForceHistory(&context, request, &history);
  };
  // Frame i presses with i tenths of a newton, half a second after the one before.
  for (uint64_t i = 1; i <= 4; ++i) {
    script_->Push([i](StereoFrame& frame) -> Result<void> {
      frame.sequence = i;
      frame.times.exposure_monotonic_ns = static_cast<int64_t>(i);
      frame.times.exposure_utc_ns = kBegin + static_cast<int64_t>(i) * 500'000'000;
      return {};
    });
    // A worker that is busy passes over all frames but the newest.
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    do {
      ASSERT_LT(std::chrono::steady_clock::now(), give_up);
      history.Clear();
      ASSERT_TRUE(ask().ok());
      ASSERT_EQ(history.links_size(), 1);
    } while (history.links(0).exposure_utc_ns_size() < static_cast<int>(i));
  }
  const v1::LinkForceHistory& link = history.links(0);
  EXPECT_EQ(link.link(), "upper");
  EXPECT_EQ(link.exposure_utc_ns(0), kBegin + 500'000'000);
  EXPECT_THAT(link.total_magnitude_n(), ElementsAre(0.1F, 0.2F, 0.3F, 0.4F));
  ASSERT_EQ(link.contacts_size(), 1);
  EXPECT_EQ(link.contacts(0).id(), 7u);
  EXPECT_THAT(link.contacts(0).samples(), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(link.contacts(0).magnitude_n(), ElementsAre(0.1F, 0.2F, 0.3F, 0.4F));
  request.set_span_s(0.7);
  history.Clear();
  ASSERT_TRUE(ask().ok());
  EXPECT_THAT(history.links(0).total_magnitude_n(), ElementsAre(0.3F, 0.4F));
  request.set_span_s(301);
  EXPECT_EQ(ask().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  request.set_span_s(3);
  request.add_links("elbow");
  EXPECT_EQ(ask().error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(LinkCallsTest, CamerasAreSetOnTheirThread) {
  WaitUntilRunning();
  v1::SetCameraRequest request;
  request.set_link("upper");
  request.set_exposure_s(0.0123);
  EXPECT_TRUE(SetCamera(request).ok());
  request.set_camera("bottom");
  request.set_automatic(true);
  request.set_gain(3);
  EXPECT_TRUE(SetCamera(request).ok());
  const std::lock_guard lock(log_->mutex);
  ASSERT_EQ(log_->set.size(), 3u);
  EXPECT_EQ(log_->set[0].first, CameraId::kTop);
  EXPECT_EQ(log_->set[1].first, CameraId::kBottom);
  EXPECT_EQ(log_->set[1].second.exposure_100us, 123);
  EXPECT_FALSE(log_->set[1].second.gain);
  EXPECT_EQ(log_->set[2].first, CameraId::kBottom);
  EXPECT_TRUE(log_->set[2].second.automatic_exposure);
  EXPECT_EQ(log_->set[2].second.gain, 3);
}

TEST_F(LinkCallsTest, CameraSettingsThatCantBeAreRefusedWithTheReason) {
  WaitUntilRunning();
  v1::SetCameraRequest request;
  request.set_link("upper");
  EXPECT_THAT(SetCamera(request).error_message(), HasSubstr("neither an exposure nor a gain"));
  request.set_gain(99);
  const auto refused = SetCamera(request);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(refused.error_message(), HasSubstr("gain must be 0 to 64"));
  request.set_camera("left");
  EXPECT_THAT(SetCamera(request).error_message(), HasSubstr("top, bottom or empty"));
  request.set_camera("top");
  request.set_exposure_s(-1);
  EXPECT_EQ(SetCamera(request).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  request.set_exposure_s(0.01);
  request.set_link("other");
  EXPECT_EQ(SetCamera(request).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(LinkCallsTest, AForceModelIsMadeAsideAndUsed) {
  WaitUntilRunning();
  EXPECT_TRUE(SetForceModel("upper", v1::FORCE_MODEL_NONLINEAR).ok());
  script_->Push(1);
  log_->used.wait(0);
  const std::lock_guard lock(log_->mutex);
  EXPECT_THAT(log_->made, ElementsAre(ForceModel::kNonlinear));
}

TEST_F(LinkCallsTest, TheChoiceOfTheForceModelIsGivenBack) {
  WaitUntilRunning();
  EXPECT_TRUE(SetForceModel("upper", v1::FORCE_MODEL_AUTO).ok());
  script_->Push(1);
  log_->used.wait(0);
  const std::lock_guard lock(log_->mutex);
  EXPECT_THAT(log_->made, ElementsAre(std::nullopt));
}

TEST_F(LinkCallsTest, AForceModelThatDoesNotHoldIsRefused) {
  WaitUntilRunning();
  const auto refused = SetForceModel("upper", v1::FORCE_MODEL_LITERAL);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(refused.error_message(), "link 'upper': it does not hold");
}

TEST_F(LinkCallsTest, AForceModelThatTheFemThreadRefusesIsNotAccepted) {
  WaitUntilRunning();
  log_->refuses = true;
  const auto refused = SetForceModel("upper", v1::FORCE_MODEL_NONLINEAR);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(refused.error_message(), "a calibration is under way");
  EXPECT_FALSE(FirstEvent(v1::EVENT_KIND_FORCE_MODEL).operation().accepted());
  EXPECT_EQ(log_->used, 0);
}

TEST_F(LinkCallsTest, NoForceModelNoChange) {
  EXPECT_EQ(SetForceModel("upper", v1::FORCE_MODEL_UNSPECIFIED).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(SetForceModel("other", v1::FORCE_MODEL_LINEAR).error_code(), grpc::StatusCode::NOT_FOUND);
  const std::lock_guard lock(log_->mutex);
  EXPECT_TRUE(log_->made.empty());
}

TEST_F(LinkCallsTest, WhatWasDoneIsInTheEvents) {
  WaitUntilRunning();
  v1::SetCameraRequest request;
  request.set_link("upper");
  request.set_gain(99);
  SetCamera(request);
  SetForceModel("upper", v1::FORCE_MODEL_LINEAR);
  grpc::ClientContext context;
  v1::StreamEventsRequest wanted;
  wanted.set_after_sequence(0);
  wanted.add_kinds(v1::EVENT_KIND_FORCE_MODEL);
  wanted.add_kinds(v1::EVENT_KIND_CAMERA);
  const auto stream = stub_->StreamEvents(&context, wanted);
  v1::StreamEventsResponse message;
  std::vector<v1::Event> events;
  while (events.size() < 2 && stream->Read(&message))
    if (message.has_event()) events.push_back(message.event());
  context.TryCancel();
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].kind(), v1::EVENT_KIND_CAMERA);
  EXPECT_FALSE(events[0].operation().accepted());
  EXPECT_EQ(events[0].operation().values().at("gain"), 99);
  EXPECT_EQ(events[1].kind(), v1::EVENT_KIND_FORCE_MODEL);
  EXPECT_TRUE(events[1].operation().accepted());
}

}  // namespace
}  // namespace taclink::server

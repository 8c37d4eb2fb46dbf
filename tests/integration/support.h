#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "client/cpp/taclink/client.h"
#include "sensing/model/model_file.h"
#include "server/arm/arm.h"
#include "server/attitude/client_attitude.h"
#include "server/hub/encoder.h"
#include "server/rpc/rpc_server.h"
#include "tests/server/support.h"
#include "tests/server/test_state.h"

namespace taclink::server {

/// A path where nothing is yet.
inline std::string NewFolder(const std::string& name) {
  static int count = 0;
  return ::testing::TempDir() + name + "." + std::to_string(::getpid()) + "." + std::to_string(++count);
}

inline constexpr size_t kQueueMessages = 32;
inline constexpr size_t kMaxStreams = 4;

inline ServiceLimits TestLimits() {
  return {.max_streams = kMaxStreams, .queue_messages = kQueueMessages};
}

/// A server of two links, "upper" and "lower", on a free port. Frames come either through fake sources and
/// the workers (after arm().Start()) or straight into the hub.
class TestServer {
 public:
  using MakePressure = std::function<std::unique_ptr<PressureSource>(size_t link, Clock& clock)>;
  explicit TestServer(ServiceLimits limits = TestLimits(), std::unique_ptr<ArmPoses> poses = nullptr,
                      const MakePressure& pressure = {}, const RecordingConfig& recording = {},
                      const std::string& address = "127.0.0.1:0",
                      mcap::FileCalls& files = mcap::FileCalls::System()) {
    for (size_t link = 0; link < 2; ++link) {
      links_.push_back(MakeLink(link));
      if (pressure) links_.back().pressure = pressure(link, clock_);
      if (link == 0)  // as clients tell it
        links_.back().attitude = std::make_shared<ClientAttitude>(0.2, std::chrono::milliseconds(200));
    }
    arm_ = std::make_unique<Arm>("test", std::move(links_), CountingEncoder(), clock_,
                                 ArmOptions{.worker = {.poll = std::chrono::milliseconds(5)},
                                            .acceptance_folder = NewFolder("acceptance")},
                                 std::move(poses));
    recorder_ = std::make_unique<Recorder>(
        *arm_, recording, LogPreamble{.files = {}, .metadata = {{"taclink", {{"arm", "test"}}}}}, files);
    auto server = RpcServer::Start(address, *arm_, limits, nullptr, recorder_.get());
    EXPECT_TRUE(server.ok()) << server.error().message;
    server_ = std::move(*server);
  }

  Arm& arm() { return *arm_; }
  RpcServer& server() { return *server_; }
  Recorder& recorder() { return *recorder_; }
  ManualClock& clock() { return clock_; }
  SourceScript& script(size_t link) { return *scripts_[link]; }
  int states_alive() const { return *alive_; }

  client::Client Connect() {
    auto client = client::Client::Connect(server_->address(), std::chrono::seconds(60));
    EXPECT_TRUE(client.ok()) << client.error().message;
    return std::move(*client);
  }

  /// Encodings so far, by level of detail.
  std::array<int, kDetailCount> encoded() const {
    std::array<int, kDetailCount> out{};
    for (size_t i = 0; i < kDetailCount; ++i) out[i] = (*encoded_)[i];
    return out;
  }

  void Publish(size_t link, uint64_t sequence, int64_t published_ns = 0, int64_t exposure_ns = 0,
               int64_t exposure_utc_ns = 0) {
    PublishNumbered(link, sequence, sequence, published_ns, exposure_ns, exposure_utc_ns);
  }
  /// With the numbers of the state `number`.
  void PublishNumbered(size_t link, uint64_t sequence, uint64_t number, int64_t published_ns,
                       int64_t exposure_ns = 0, int64_t exposure_utc_ns = 0) {
    auto* state = new LinkState;
    FillTestState(link, number, *state);
    state->sequence = sequence;
    state->times.published_ns = published_ns;
    state->times.exposure_monotonic_ns = exposure_ns;
    state->times.exposure_utc_ns = exposure_utc_ns;
    ++*alive_;
    arm_->hub().Publish(link, {state, [alive = alive_](const LinkState* done) {
                                 --*alive;
                                 delete done;
                               }});
  }

  void Stop() { server_->Shutdown("server is shutting down", kForever); }

 private:
  FrameEncoder CountingEncoder() const {
    return [encode = MakeEncoder({"upper", "lower"}), encoded = encoded_](size_t link, const LinkState& state,
                                                                          Detail detail) {
      ++(*encoded)[Index(detail)];
      return encode(link, state, detail);
    };
  }
  LinkParts MakeLink(size_t link) {
    auto model = LoadLinkModel(link == 0 ? "cylinder" : "barrel");
    EXPECT_TRUE(model.ok());
    scripts_.push_back(std::make_shared<SourceScript>());
    return {
        .description = {.name = link == 0 ? "upper" : "lower",
                        .model = *model,
                        .base_from_link = {Mat3::Identity(), Vec3(0, 0, 250.0 * static_cast<double>(link))},
                        .source = SourceKind::kSimulated},
        .source = std::make_unique<FakeSource>(scripts_.back()),
        .processor = std::make_unique<FakeProcessor>([link](const StereoFrame& frame, LinkState& state) {
          FillTestState(link, frame.sequence, state);
          state.times = frame.times;
          state.pressure = frame.pressure;
          state.specific_force = frame.specific_force;
          if (frame.pressure.origin != PressureOrigin::kNone) state.pressure_mpa = frame.pressure_mpa;
        })};
  }

  ManualClock clock_;
  const std::shared_ptr<std::atomic<int>> alive_ = std::make_shared<std::atomic<int>>(0);
  const std::shared_ptr<std::array<std::atomic<int>, kDetailCount>> encoded_ =
      std::make_shared<std::array<std::atomic<int>, kDetailCount>>();
  std::vector<std::shared_ptr<SourceScript>> scripts_;
  std::vector<LinkParts> links_;
  std::unique_ptr<Arm> arm_;
  std::unique_ptr<Recorder> recorder_;
  std::unique_ptr<RpcServer> server_;
};

inline std::unique_ptr<client::FrameReader> Stream(client::Client& client,
                                                   const v1::StreamFramesRequest& request) {
  auto reader = client.StreamFrames(request);
  EXPECT_TRUE(reader.ok()) << reader.error().message;
  return reader.ok() ? std::move(*reader) : nullptr;
}

inline v1::LinkFrame NextOf(client::FrameReader& reader) {
  auto frame = reader.Next(kForever);
  EXPECT_TRUE(frame.ok()) << frame.error().message;
  return frame.ok() ? std::move(*frame) : v1::LinkFrame{};
}

inline v1::StreamFramesRequest Every(v1::Detail detail = v1::DETAIL_CONTACTS) {
  v1::StreamFramesRequest request;
  request.set_detail(detail);
  request.set_delivery(v1::DELIVERY_EVERY);
  return request;
}

/// The newest frames of these links.
inline v1::StreamFramesRequest OfLinks(const std::vector<std::string>& links) {
  v1::StreamFramesRequest request;
  request.mutable_links()->Assign(links.begin(), links.end());
  return request;
}

inline v1::StreamEventsRequest EventsOf(const std::vector<v1::EventKind>& kinds) {
  v1::StreamEventsRequest request;
  request.mutable_kinds()->Assign(kinds.begin(), kinds.end());
  return request;
}

inline v1::Thresholds MakeThresholds(double warning_n, double alarm_n = 0, double hysteresis_n = 0.05) {
  v1::Thresholds thresholds;
  thresholds.set_warning_n(warning_n);
  thresholds.set_alarm_n(alarm_n);
  thresholds.set_hysteresis_n(hysteresis_n);
  return thresholds;
}

/// Exposes a frame of a fake source now, and waits until a client gets it.
inline v1::LinkFrame NextFrame(TestServer& server, client::FrameReader& reader, size_t link,
                               uint64_t sequence) {
  server.script(link).Push(sequence, server.clock().MonotonicNs());
  while (true) {
    auto frame = reader.Next(kForever);
    EXPECT_TRUE(frame.ok()) << frame.error().message;
    if (!frame || (frame->sequence() == sequence && frame->times().exposure_ns() != 0))
      return std::move(*frame);
  }
}

}  // namespace taclink::server

#include "tests/v4l2/rig.h"

#include <ctime>
#include <fstream>

#include "sensing/model/model_file.h"
#include "sensing/pipeline/picture_stage.h"
#include "server/assembly/source_factory.h"
#include "server/config/config.h"
#include "server/hub/encoder.h"
#include "tests/server/test_state.h"

namespace taclink::testing {
namespace {

constexpr std::array kLinks = {"a", "b"};

/// Judges a frame's images and invents the rest.
class ImageProcessor final : public server::LinkProcessor {
 public:
  explicit ImageProcessor(const StereoRig& rig) : rig_(rig) {
    for (const CameraId id : kBothCameras) {
      rig_[id].width_px = kRigWidthPx;
      rig_[id].height_px = kRigHeightPx;
    }
  }

  void Process(const StereoFrame& frame, LinkState& state) override {
    server::FillTestState(0, frame.sequence, state);
    state.times = frame.times;
    state.reasons.clear();
    images_.Take(frame, rig_, ImageRepeats::kFault, false, state);
    if (!images_.trouble()) return;
    state.status = LinkStatus::kDegraded;
    state.status_reason = images_.trouble()->text;
    state.reasons.push_back(*images_.trouble());
  }
  Result<void> BeginCalibration(const server::CalibrationOrder&) override {
    return Error{ErrorCode::kUnsupported, "the rig's links have no markers"};
  }
  server::CalibrationProgress PollCalibration() override { return {}; }
  void CancelCalibration() override {}

 private:
  StereoRig rig_;
  PictureStage images_;
};

server::LinkConfig LinkConfig(const std::string& name, std::optional<PixelFormat> format) {
  server::LinkConfig config;
  config.name = name;
  config.source =
      server::V4l2SourceConfig{.devices = {"serial:" + name + "-top", "serial:" + name + "-bottom"},
                               .width_px = kRigWidthPx,
                               .height_px = kRigHeightPx,
                               .frame_rate_hz = kRigRateHz,
                               .format = format,
                               .exposure_100us = {},
                               .gain = {}};
  return config;
}

Result<server::LinkParts> MakeLink(const server::LinkConfig& config, Clock& clock) {
  auto model = LoadLinkModel("cylinder");
  if (!model) return model.error();
  auto source = server::MakeSource(config, *model, clock);
  if (!source) return source.error();
  auto processor = std::make_unique<ImageProcessor>(model->nominal_rig);
  return server::LinkParts{.description = {.name = config.name,
                                           .model = std::move(*model),
                                           .base_from_link = {},
                                           .source = server::SourceKind::kV4l2},
                           .source = std::move(*source),
                           .processor = std::move(processor)};
}

}  // namespace

int64_t MonotonicNs() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

Rig::Rig() {
  // The virtual hub loses devices that the kernel put to sleep.
  std::ofstream("/sys/module/usbcore/parameters/autosuspend") << -1;
  for (const char* link : kLinks) {
    for (const CameraId id : kBothCameras) {
      cameras_.push_back(std::make_unique<EmulatedCamera>(std::string(link) + "-" + Name(id),
                                                          pictures_[Index(id)].Source()));
    }
  }
}

Rig::~Rig() {
  StopServer();
}

void Rig::StopServer() {
  receiver_.request_stop();
  if (receiver_.joinable()) receiver_.join();
  reader_.reset();
  client_.reset();
  if (server_) server_->Shutdown("the rig ends", std::chrono::seconds(60));
  server_.reset();
  arm_.reset();
}

std::string Rig::StartServer() {
  std::vector<server::LinkParts> links;
  for (const auto& config : {LinkConfig("a", PixelFormat::kMjpeg), LinkConfig("b", std::nullopt)}) {
    auto link = MakeLink(config, clock_);
    if (!link) return link.error().message;
    links.push_back(std::move(*link));
  }
  arm_ = std::make_unique<server::Arm>("rig", std::move(links), server::MakeEncoder({"a", "b"}), clock_,
                                       server::ArmOptions{});
  auto server = server::RpcServer::Start("127.0.0.1:0", *arm_, {});
  if (!server) return server.error().message;
  server_ = std::move(*server);
  arm_->Start();
  auto client = client::Client::Connect(address(), std::chrono::seconds(60));
  if (!client) return client.error().message;
  client_ = std::move(*client);
  v1::StreamFramesRequest every;
  every.set_delivery(v1::DELIVERY_EVERY);
  auto reader = client_->StreamFrames(every, std::chrono::seconds(60));
  if (!reader) return reader.error().message;
  reader_ = std::move(*reader);
  receiver_ = std::jthread([this](const std::stop_token& stop) { Receive(stop); });
  return "";
}

v1::Arm Rig::Arm() {
  auto arm = client_->GetArm(std::chrono::seconds(60));
  return arm ? std::move(*arm) : v1::Arm{};
}

void Rig::Receive(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    auto frame = reader_->Next(std::chrono::milliseconds(200));
    if (!frame && frame.error().code == ErrorCode::kTimeout) continue;
    if (!frame) return;
    const std::lock_guard lock(mutex_);
    frames_.push_back({std::move(*frame), MonotonicNs()});
    received_.notify_all();
  }
}

std::optional<ReceivedFrame> Rig::Await(const std::string& link, int64_t after_ns, const Wanted& wanted) {
  std::unique_lock lock(mutex_);
  size_t looked_at = 0;
  std::optional<ReceivedFrame> found;
  received_.wait_for(lock, std::chrono::duration<double>(kRigForever), [&] {
    for (; looked_at < frames_.size() && !found; ++looked_at) {
      const ReceivedFrame& each = frames_[looked_at];
      if (each.received_ns > after_ns && each.frame.link() == link && wanted(each.frame)) found = each;
    }
    return found.has_value();
  });
  return found;
}

std::vector<ReceivedFrame> Rig::Frames(const std::string& link, int64_t from_ns, int64_t to_ns) {
  const std::lock_guard lock(mutex_);
  std::vector<ReceivedFrame> out;
  for (const ReceivedFrame& each : frames_) {
    if (each.frame.link() == link && each.received_ns >= from_ns && each.received_ns <= to_ns &&
        each.frame.times().exposure_ns() != 0) {
      out.push_back(each);
    }
  }
  return out;
}

}  // namespace taclink::testing

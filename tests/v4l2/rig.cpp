#include "tests/v4l2/rig.h"

#include <ctime>
#include <fstream>

#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

constexpr const char* kConfigPath = "/tmp/rig.yaml";

std::string LinkConfig(const char* link, const char* format) {
  const std::string name(link);
  return "    - name: " + name +
         "\n      model: cylinder\n      source: v4l2\n      devices: [\"serial:" + name +
         "-top\", \"serial:" + name + "-bottom\"]\n      frame_rate_hz: " + std::to_string(kRigRateHz) +
         "\n      format: " + format +
         "\n      pressure_kpa: 0\n      force_model: linear\n";  // the scene's too; others cost the guest
                                                                  // minutes
}

}  // namespace

int64_t MonotonicNs() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

Rig::Rig(const std::string& picture_folder) : pictures_(picture_folder, kRigRateHz) {
  // The virtual hub loses devices that the kernel put to sleep.
  std::ofstream("/sys/module/usbcore/parameters/autosuspend") << -1;
  for (const char* link : {"a", "b"}) {
    for (const CameraId id : kBothCameras) {
      cameras_.push_back(
          std::make_unique<EmulatedCamera>(std::string(link) + "-" + Name(id), pictures_.For(id)));
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
  server_.reset();
}

std::string Rig::StartServer() {
  std::ofstream(kConfigPath) << "taclink_config: 1\narm:\n  name: rig\n  links:\n"
                             << LinkConfig("a", "mjpeg") << LinkConfig("b", "auto");
  server_ = std::make_unique<Process>(
      std::vector<std::string>{kTaclinkd, "--config", kConfigPath, "--listen", "127.0.0.1:0"});
  const auto line = server_->ReadUntil("listening on ", std::chrono::seconds(60), true);
  if (!line) return "the server does not start: " + server_->Wait(std::chrono::seconds(1)).err;
  address_ = line->substr(line->find("listening on ") + 13);
  auto client = client::Client::Connect(address_, std::chrono::seconds(60));
  if (!client) return client.error().message;
  client_ = std::move(*client);
  auto reader = client_->StreamFrames({.delivery = client::Delivery::kEvery}, std::chrono::seconds(60));
  if (!reader) return reader.error().message;
  reader_ = std::move(*reader);
  receiver_ = std::jthread([this](const std::stop_token& stop) { Receive(stop); });
  return "";
}

client::Arm Rig::Arm() {
  auto arm = client_->GetArm(std::chrono::seconds(60));
  return arm ? std::move(*arm) : client::Arm{};
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
      if (each.received_ns > after_ns && each.frame.link == link && wanted(each.frame)) found = each;
    }
    return found.has_value();
  });
  return found;
}

std::vector<ReceivedFrame> Rig::Frames(const std::string& link, int64_t from_ns, int64_t to_ns) {
  const std::lock_guard lock(mutex_);
  std::vector<ReceivedFrame> out;
  for (const ReceivedFrame& each : frames_) {
    if (each.frame.link == link && each.received_ns >= from_ns && each.received_ns <= to_ns &&
        each.frame.times.exposure_ns != 0) {
      out.push_back(each);
    }
  }
  return out;
}

}  // namespace taclink::testing

#include "bench/server/server_load.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <sstream>
#include <thread>

#include "bench/server/server_process.h"
#include "bench/vision/vision_score.h"
#include "sensing/capture/image_io.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink::command {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// At rest, long enough for many links to find their baselines at the same time, then a touch, 6 mm deep
// within 0.15 s, that is gone before the pictures begin again.
constexpr const char* kScene = R"(taclink_scene: 1
name: load
model: cylinder
frame_rate_hz: 30
duration_s: 2
contacts:
  - {at: {path: 7, ring: 5}, force_n: 0.1, begin_s: 1.35, end_s: 1.95, ramp_s: 0.15}
)";
constexpr int kPairs = 60;
constexpr std::chrono::seconds kWarmUpPatience{180};
constexpr std::chrono::seconds kWarmUp{2};
constexpr milliseconds kPoll{100};
constexpr milliseconds kCountsLag{1500};  // the server tells drops once a second

int64_t MonotonicNs() {
  return std::chrono::nanoseconds(steady_clock::now().time_since_epoch()).count();
}

/// One client with a connection and a thread of its own.
class LoadClient {
 public:
  static Result<std::unique_ptr<LoadClient>> Start(const std::string& address, v1::Detail detail) {
    auto connection = client::Client::Connect(address, client::Patience(std::chrono::seconds(10)));
    if (!connection) return connection.error();
    v1::StreamFramesRequest request;
    request.set_detail(detail);
    request.set_delivery(v1::DELIVERY_EVERY);
    auto reader = connection->StreamFrames(request);
    if (!reader) return reader.error();
    return std::unique_ptr<LoadClient>(new LoadClient(std::move(*connection), std::move(*reader)));
  }

  ~LoadClient() {
    if (thread_.joinable()) Stop();
  }

  /// From now on frames count.
  void Begin() {
    dropped_before_ = dropped_.load();
    measuring_ = true;
  }
  void End() { measuring_ = false; }
  /// After this the results may be read.
  void Stop() {
    reader_->Cancel();
    thread_.join();
  }

  uint64_t received() const { return exposure_ms_.size(); }
  uint64_t dropped() const { return dropped_ - dropped_before_; }
  const std::vector<float>& exposure_ms() const { return exposure_ms_; }
  const std::vector<float>& memory_ms() const { return memory_ms_; }
  const std::vector<float>& stages_ms() const { return stages_ms_; }
  const std::optional<Error>& error() const { return error_; }

 private:
  LoadClient(client::Client connection, std::unique_ptr<client::FrameReader> reader)
      : connection_(std::move(connection)), reader_(std::move(reader)), thread_([this] { Read(); }) {}

  void Read() {
    while (true) {
      const auto frame = reader_->Next(kPoll);
      const int64_t now_ns = MonotonicNs();
      uint64_t dropped = 0;
      for (const auto& link : reader_->status().links()) dropped += link.frames_dropped();
      dropped_ = dropped;
      if (!frame && frame.error().code == ErrorCode::kTimeout) continue;
      if (!frame) {
        if (frame.error().code != ErrorCode::kEndOfData) error_ = frame.error();
        return;
      }
      if (!measuring_ || frame->times().exposure_ns() == 0) continue;
      exposure_ms_.push_back(
          static_cast<float>(static_cast<double>(now_ns - frame->times().exposure_ns()) * 1e-6));
      memory_ms_.push_back(
          static_cast<float>(static_cast<double>(now_ns - frame->times().received_ns()) * 1e-6));
      const v1::StageTimes& stages = frame->stage_times();
      stages_ms_.push_back(static_cast<float>(
          (stages.decode_s() + stages.detect_s() + stages.register_s() + stages.force_s()) * 1e3));
    }
  }

  client::Client connection_;
  std::unique_ptr<client::FrameReader> reader_;
  std::atomic<bool> measuring_ = false;
  std::atomic<uint64_t> dropped_ = 0;
  uint64_t dropped_before_ = 0;
  // Of the thread, until it was joined.
  std::vector<float> exposure_ms_, memory_ms_, stages_ms_;
  std::optional<Error> error_;
  std::thread thread_;
};

using LoadClients = std::vector<std::unique_ptr<LoadClient>>;

Result<void> Collect(LoadClients& clients, LoadResult& result) {
  std::vector<float> exposure_ms, memory_ms, stages_ms, beside_ms;
  for (const auto& client : clients) {
    client->Stop();
    if (client->error()) return *client->error();
    result.received += client->received();
    result.dropped += client->dropped();
    exposure_ms.insert(exposure_ms.end(), client->exposure_ms().begin(), client->exposure_ms().end());
    memory_ms.insert(memory_ms.end(), client->memory_ms().begin(), client->memory_ms().end());
    stages_ms.insert(stages_ms.end(), client->stages_ms().begin(), client->stages_ms().end());
  }
  if (exposure_ms.empty()) return Error{ErrorCode::kUnavailable, "no frame reached any client"};
  std::transform(memory_ms.begin(), memory_ms.end(), stages_ms.begin(), std::back_inserter(beside_ms),
                 std::minus<>());
  result.exposure_p50_ms = Percentile(exposure_ms, 0.5);
  result.exposure_p99_ms = Percentile(exposure_ms, 0.99);
  result.memory_p50_ms = Percentile(memory_ms, 0.5);
  result.memory_p99_ms = Percentile(memory_ms, 0.99);
  result.stages_p99_ms = Percentile(stages_ms, 0.99);
  result.beside_p99_ms = Percentile(beside_ms, 0.99);
  return {};
}

Result<LoadResult> Measure(const ServerLoad& load, const ServerProcess& server, client::Client& connection,
                           double seconds) {
  LoadResult result{.load = load};
  LoadClients clients;
  for (int i = 0; i < load.clients; ++i) {
    auto client = LoadClient::Start(server.address(), load.detail);
    if (!client) return client.error();
    clients.push_back(std::move(*client));
  }
  std::this_thread::sleep_for(kWarmUp);
  const auto skipped_before = FramesSkipped(connection);
  if (!skipped_before) return skipped_before.error();
  const ProcessUsage server_before = server.Usage(), own_before = OwnUsage(), all_before = MachineUsage();
  const auto begin = steady_clock::now();
  for (const auto& client : clients) client->Begin();
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  for (const auto& client : clients) client->End();
  result.seconds = std::chrono::duration<double>(steady_clock::now() - begin).count();
  const ProcessUsage server_after = server.Usage(), own_after = OwnUsage(), all_after = MachineUsage();
  const auto skipped_after = FramesSkipped(connection);
  if (!skipped_after) return skipped_after.error();
  result.skipped = *skipped_after - *skipped_before;
  result.server_cores = (server_after.cpu_s - server_before.cpu_s) / result.seconds;
  result.clients_cores = (own_after.cpu_s - own_before.cpu_s) / result.seconds;
  result.other_cores = std::max(0.0, (all_after.cpu_s - all_before.cpu_s) / result.seconds -
                                         result.server_cores - result.clients_cores);
  result.server_mb = server_after.resident_mb;
  std::this_thread::sleep_for(kCountsLag);
  if (const auto collected = Collect(clients, result); !collected) return collected.error();
  return result;
}

}  // namespace

Result<void> WaitUntilMeasuring(client::Client& connection) {
  const auto give_up = steady_clock::now() + kWarmUpPatience;
  std::string reason;
  while (steady_clock::now() < give_up) {
    const auto arm = connection.GetArm();
    if (!arm) return arm.error();
    const bool all = std::all_of(arm->links().begin(), arm->links().end(), [](const v1::Link& link) {
      return link.status() == v1::LINK_STATUS_OK || link.status() == v1::LINK_STATUS_DEGRADED;
    });
    if (all) return {};
    for (const v1::Link& link : arm->links()) {
      if (!link.status_reason().empty()) reason = link.name() + " says: " + link.status_reason();
    }
    std::this_thread::sleep_for(kPoll);
  }
  return Error{ErrorCode::kTimeout, "the links did not begin to measure within three minutes; " + reason};
}

Result<uint64_t> FramesSkipped(client::Client& connection) {
  const auto arm = connection.GetArm();
  if (!arm) return arm.error();
  uint64_t skipped = 0;
  for (const v1::Link& link : arm->links()) skipped += link.statistics().frames_skipped();
  return skipped;
}

Result<LoadPictures> RenderLoadPictures(const std::string& folder) {
  auto scene = ParseScene("load", kScene);
  if (!scene) return scene.error();
  const auto model = LoadLinkModel(scene->model);
  if (!model) return model.error();
  const auto skin = SimulatedSkin::Make(*model, *scene);
  if (!skin) return skin.error();
  Renderer renderer(*model, MountedRig(model->nominal_rig, scene->camera), scene->camera, scene->seed);
  LoadPictures pictures{.folder = folder, .pairs = kPairs};
  SkinTruth truth;
  cv::Mat gray;
  for (int pair = 0; pair < kPairs; ++pair) {
    (*skin)->Evaluate(pair / scene->frame_rate_hz, truth);
    for (const CameraId id : kBothCameras) {
      renderer.Render(truth, id, gray);
      pictures.megabytes += static_cast<double>(gray.total()) / (1 << 20);
      char name[64];
      std::snprintf(name, sizeof name, "%s_%06d.png", Name(id), pair);
      const auto written = WritePng((std::filesystem::path(folder) / name).string(), gray);
      if (!written) return written.error();
    }
  }
  return pictures;
}

std::string LoadConfigText(const LoadPictures& pictures, int links, double rate_hz, bool yuyv) {
  std::ostringstream text;
  text << "taclink_config: 1\nlimits: {max_streams: 1000, max_streams_per_peer: 1000}\n"
       << "arm:\n  name: load\n  links:\n";
  for (int link = 0; link < links; ++link) {
    // Neither the exposures nor the touches of the links are in step.
    const double after_s = (kPairs + 1) / rate_hz * link / links;
    text << "    - {name: link" << link << ", model: cylinder, source: files, folder: \"" << pictures.folder
         << "\", frame_rate_hz: " << rate_hz << ", start_after_s: " << after_s
         << ", in_memory: true, yuyv: " << (yuyv ? "true" : "false") << "}\n";
  }
  return text.str();
}

Result<std::vector<LoadResult>> MeasureLoads(const std::vector<ServerLoad>& loads,
                                             const LoadPictures& pictures, const std::string& taclinkd,
                                             double seconds, const std::string& more) {
  const int links = loads.front().links;
  const auto folder = std::filesystem::path(pictures.folder);
  const std::string config = (folder / "load.yaml").string(), log = (folder / "load.log").string();
  std::ofstream(config) << LoadConfigText(pictures, links, loads.front().rate_hz) << more;
  const auto server = ServerProcess::Start(taclinkd, config, log);
  if (!server) return server.error();
  auto connection = client::Client::Connect((*server)->address(), client::Patience(std::chrono::seconds(10)));
  if (!connection) return connection.error();
  if (const auto ready = WaitUntilMeasuring(*connection); !ready) return ready.error();
  std::vector<LoadResult> results;
  for (const ServerLoad& load : loads) {
    auto result = Measure(load, **server, *connection, seconds);
    if (!result) return result.error();
    result->server_mb = std::max(0.0, result->server_mb - pictures.megabytes * links);
    results.push_back(*result);
  }
  return results;
}

}  // namespace taclink::command

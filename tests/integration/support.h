#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "client/taclink/client.h"
#include "sensing/model/model_file.h"
#include "server/arm.h"
#include "server/assembly/encoder.h"
#include "server/rpc/rpc_server.h"
#include "tests/server/support.h"

namespace taclink::server {

inline constexpr size_t kQueueMessages = 32;
inline constexpr size_t kMaxStreams = 4;

/// A state whose every number follows from link and sequence.
inline void FillTestState(size_t link, uint64_t sequence, LinkState& state) {
  constexpr size_t kMarkers = 256;
  const auto number = static_cast<double>(sequence);
  state.sequence = sequence;
  state.status = LinkStatus::kOk;
  state.status_reason.clear();
  state.pressure_mpa = 0.001 * number;
  state.shape.positions_mm.assign(kMarkers, Vec3(number, static_cast<double>(link), 3));
  state.shape.displacements_mm.assign(kMarkers, Vec3(0, 0, number));
  state.shape.covariances_mm2.assign(kMarkers, Mat3::Identity());
  state.shape.sources.assign(kMarkers, MarkerSource::kBoth);
  state.forces.forces_n.assign(kMarkers, Vec3(0.5, 0, 0));
  state.forces.sigmas_n.assign(kMarkers, 0.25);
  Contact contact;
  contact.id = 7;
  contact.center_mm = Vec3(36.5, 0, number);
  contact.normal = Vec3::UnitX();
  contact.force_n = Vec3(-0.1 * number, 0, 0);
  contact.normal_force_n = 0.1 * number;
  contact.area_mm2 = 100;
  state.contacts.assign(1, contact);
  state.total_force_n = contact.force_n;
}

/// A server of two links, "upper" and "lower", on a free port. Frames come either through fake sources and
/// the workers (after arm().Start()) or straight into the hub.
class TestServer {
 public:
  TestServer() {
    for (size_t link = 0; link < 2; ++link) links_.push_back(MakeLink(link));
    arm_ = std::make_unique<Arm>("test", std::move(links_), MakeEncoder({"upper", "lower"}), clock_,
                                 LinkWorkerOptions{.poll = std::chrono::milliseconds(5)});
    auto server = RpcServer::Start("127.0.0.1:0", *arm_,
                                   {.max_streams = kMaxStreams, .queue_messages = kQueueMessages});
    EXPECT_TRUE(server.ok()) << server.error().message;
    server_ = std::move(*server);
  }

  Arm& arm() { return *arm_; }
  RpcServer& server() { return *server_; }
  ManualClock& clock() { return clock_; }
  SourceScript& script(size_t link) { return *scripts_[link]; }
  int states_alive() const { return *alive_; }

  client::Client Connect() {
    auto client = client::Client::Connect(server_->address(), std::chrono::seconds(60));
    EXPECT_TRUE(client.ok()) << client.error().message;
    return std::move(*client);
  }

  void Publish(size_t link, uint64_t sequence, int64_t published_ns = 0) {
    auto* state = new LinkState;
    FillTestState(link, sequence, *state);
    state->times.published_ns = published_ns;
    ++*alive_;
    arm_->hub().Publish(link, {state, [alive = alive_](const LinkState* done) {
                                 --*alive;
                                 delete done;
                               }});
  }

  void Stop() { server_->Shutdown("server is shutting down", kForever); }

 private:
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
        })};
  }

  ManualClock clock_;
  const std::shared_ptr<std::atomic<int>> alive_ = std::make_shared<std::atomic<int>>(0);
  std::vector<std::shared_ptr<SourceScript>> scripts_;
  std::vector<LinkParts> links_;
  std::unique_ptr<Arm> arm_;
  std::unique_ptr<RpcServer> server_;
};

inline std::unique_ptr<client::FrameReader> Stream(client::Client& client,
                                                   const client::StreamOptions& options) {
  auto reader = client.StreamFrames(options);
  EXPECT_TRUE(reader.ok()) << reader.error().message;
  return reader.ok() ? std::move(*reader) : nullptr;
}

inline client::StreamOptions Every(client::Detail detail = client::Detail::kContacts) {
  return {.detail = detail, .delivery = client::Delivery::kEvery};
}

}  // namespace taclink::server

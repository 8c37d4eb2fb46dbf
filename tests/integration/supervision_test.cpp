// A link whose worker dies, seen and mended through the API.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

/// One link, "arm", whose processor fails with every frame below 10.
class SupervisionTest : public ::testing::Test {
 protected:
  SupervisionTest() {
    std::vector<LinkParts> links;
    links.push_back({.description = {.name = "arm", .model = *LoadLinkModel("cylinder")},
                     .source = MakeSource(),
                     .processor = MakeProcessor(),
                     .factories = {.source = [this] { return Result(MakeSource()); },
                                   .processor = [] { return Result(MakeProcessor()); }}});
    arm_ = std::make_unique<Arm>(
        "test", std::move(links), MakeEncoder({"arm"}), clock_,
        ArmOptions{
            .worker = {.poll = std::chrono::milliseconds(1), .supervisor = {.stall = std::chrono::hours(10)}},
            .watchdog = {.abandon = std::chrono::hours(10), .build = std::chrono::hours(10)}});
    server_ = std::move(*RpcServer::Start("127.0.0.1:0", *arm_, {}));
    arm_->Start();
  }
  ~SupervisionTest() override {
    server_->Shutdown("end", kForever);
    arm_->Stop();
  }

  std::unique_ptr<FrameSource> MakeSource() { return std::make_unique<FakeSource>(script_); }
  static std::unique_ptr<LinkProcessor> MakeProcessor() {
    return std::make_unique<FakeProcessor>([](const StereoFrame& frame, LinkState& state) {
      if (frame.sequence < 10) throw 42;
      FillTestState(0, frame.sequence, state);
      state.times = frame.times;
    });
  }

  // Lets time pass until the link is as wanted.
  v1::Link Until(client::Client& client, v1::Supervision wanted, uint64_t restarts) {
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    while (std::chrono::steady_clock::now() < give_up) {
      auto arm = client.GetArm();
      if (!arm) break;
      const v1::Link& link = arm->links(0);
      if (link.supervision() == wanted && link.statistics().worker_restarts() == restarts) return link;
      clock_.Advance(std::chrono::milliseconds(1));
    }
    ADD_FAILURE() << "the link does not become " << client::Name(wanted);
    return {};
  }

  ManualClock clock_;
  const std::shared_ptr<SourceScript> script_ = std::make_shared<SourceScript>();
  std::unique_ptr<Arm> arm_;
  std::unique_ptr<RpcServer> server_;
};

TEST_F(SupervisionTest, ALinkThatRestsSaysSoAndIsRestartedByTheOperator) {
  auto client = client::Client::Connect(server_->address(), kForever);
  ASSERT_TRUE(client.ok());
  const auto stream = Stream(*client, Every());
  for (uint64_t death = 1; death <= 2; ++death) {
    script_->Push(death);
    EXPECT_THAT(Until(*client, v1::SUPERVISION_RUNNING, death).statistics().last_failure(),
                HasSubstr("unknown type"));
  }
  script_->Push(3);
  const v1::Link resting = Until(*client, v1::SUPERVISION_RESTING, 2);
  EXPECT_THAT(resting.supervision_reason(), HasSubstr("taclink restart --link arm"));
  auto frame = stream->Next(kForever);
  while (frame.ok() && frame->status_reason().find("taclink restart") == std::string::npos)
    frame = stream->Next(kForever);
  ASSERT_TRUE(frame.ok()) << frame.error().message;
  EXPECT_EQ(frame->status(), v1::LINK_STATUS_LOST);

  ASSERT_TRUE(client->RestartLink("arm").ok());
  Until(*client, v1::SUPERVISION_RUNNING, 3);
  script_->Push(10);
  while (frame.ok() && frame->sequence() != 10) frame = stream->Next(kForever);
  EXPECT_EQ(frame->status(), v1::LINK_STATUS_OK);
}

TEST_F(SupervisionTest, AnUnknownLinkIsNamed) {
  auto client = client::Client::Connect(server_->address(), kForever);
  ASSERT_TRUE(client.ok());
  const auto refused = client->RestartLink("leg");
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(refused.error().message, HasSubstr("no link 'leg'; this arm has arm"));
}

}  // namespace
}  // namespace taclink::server

// Acceptances over gRPC, by the C++ client.
#include "client/cpp/taclink/acceptance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>

#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

constexpr const char* kPlan =
    "taclink_acceptance: 1\nname: small\nseries: [{name: a, force_n: 8, markers: [1, 5, 1, 5]}]\n";

class AcceptanceTest : public ::testing::Test {
 protected:
  Result<v1::Acceptance> Start(const std::string& link, const std::string& text) {
    v1::StartAcceptanceRequest request;
    request.set_link(link);
    request.set_plan_text(text);
    return calls_.Start(request);
  }
  static v1::MeasureTrialRequest TrialRequest(const std::string& link, uint32_t trial) {
    v1::MeasureTrialRequest request;
    request.set_link(link);
    request.set_trial(trial);
    request.set_duration_s(0.5);
    return request;
  }
  // Frames of the upper link until the measurement has ended: a contact of 9 N at path 1, ring 5 (z = 90 mm).
  Result<v1::Acceptance> Measure(const v1::MeasureTrialRequest& request) {
    auto end = std::async(std::launch::async, [&] { return calls_.Measure(request); });
    for (uint64_t sequence = 1; end.wait_for(std::chrono::milliseconds(2)) != std::future_status::ready;
         ++sequence) {
      server_.clock().Advance(std::chrono::milliseconds(33));
      server_.PublishNumbered(0, sequence, 90, 0, server_.clock().MonotonicNs(), server_.clock().UtcNs());
    }
    return end.get();
  }

  TestServer server_;
  client::Client client_ = server_.Connect();
  client::Acceptances calls_ = client_.AcceptanceCalls();
};

TEST_F(AcceptanceTest, TrialIsMeasuredFinishedAndShownWithTheLink) {
  const auto started = Start("upper", kPlan);
  ASSERT_TRUE(started.ok()) << started.error().message;
  ASSERT_EQ(started->trials_size(), 2);
  v1::MeasureTrialRequest request = TrialRequest("upper", 1);
  request.mutable_reference()->set_force_n(9);
  const auto measured = Measure(request);
  ASSERT_TRUE(measured.ok()) << measured.error().message;
  const v1::AcceptanceTrial& trial = measured->trials(0);
  EXPECT_EQ(trial.state(), v1::TRIAL_STATE_MEASURED);
  EXPECT_GE(trial.loaded().frames(), 15u);
  EXPECT_TRUE(trial.loaded().has_contact());
  EXPECT_NEAR(trial.loaded().force_n(), 9, 1e-9);
  EXPECT_NEAR(trial.reference().place_m().z(), 0.090, 1e-9);
  EXPECT_NEAR(trial.reference().direction().x(), -1, 1e-9);
  EXPECT_EQ(measured->next_trial(), 2u);
  EXPECT_FALSE(client_.GetArm()->links(0).has_acceptance());

  v1::FinishAcceptanceRequest finish;
  finish.set_link("upper");
  const auto finished = calls_.Finish(finish);
  ASSERT_TRUE(finished.ok()) << finished.error().message;
  EXPECT_EQ(finished->report().verdict(), v1::ACCEPTANCE_VERDICT_UNDECIDED);
  const auto arm = client_.GetArm();
  ASSERT_TRUE(arm.ok());
  ASSERT_TRUE(arm->links(0).has_acceptance());
  EXPECT_NEAR(arm->links(0).acceptance().force_bias(), 0, 1e-9);
  EXPECT_FALSE(arm->links(1).has_acceptance());
}

// A robot's probe is known in the arm's base: the lower link sits 250 mm up.
TEST_F(AcceptanceTest, ReferencesInTheBaseFrameAreTurnedIntoTheLinks) {
  ASSERT_TRUE(Start("lower", "taclink_acceptance: 1\nname: s\nseries: [{name: a, force_n: 1}]\n").ok());
  v1::MeasureTrialRequest request = TrialRequest("lower", 1);
  v1::TrialReference& reference = *request.mutable_reference();
  reference.set_in_base_frame(true);
  reference.mutable_place_m()->set_x(0.05);
  reference.mutable_place_m()->set_z(0.38);
  reference.mutable_direction()->set_x(-4);
  auto end = std::async(std::launch::async, [&] { return calls_.Measure(request); });
  for (uint64_t sequence = 1; end.wait_for(std::chrono::milliseconds(2)) != std::future_status::ready;
       ++sequence) {
    server_.clock().Advance(std::chrono::milliseconds(33));
    server_.PublishNumbered(1, sequence, 130, 0, server_.clock().MonotonicNs());
  }
  const auto measured = end.get();
  ASSERT_TRUE(measured.ok()) << measured.error().message;
  EXPECT_NEAR(measured->trials(0).reference().place_m().z(), 0.13, 1e-9);
  EXPECT_NEAR(measured->trials(0).reference().direction().x(), -1, 1e-9);
}

TEST_F(AcceptanceTest, OneMeasurementOfALinkAtATime) {
  ASSERT_TRUE(Start("upper", kPlan).ok());
  auto first = std::async(std::launch::async, [&] { return calls_.Measure(TrialRequest("upper", 1)); });
  while (server_.arm().hub().Totals().subscribers == 0) std::this_thread::yield();
  const auto second = client_.AcceptanceCalls().Measure(TrialRequest("upper", 2));
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().code, ErrorCode::kResourceExhausted);
  server_.clock().Advance(std::chrono::seconds(6));
  const auto silent = first.get();
  ASSERT_FALSE(silent.ok());
  EXPECT_EQ(silent.error().code, ErrorCode::kUnavailable);
  EXPECT_TRUE(Measure(TrialRequest("upper", 1)).ok());
}

TEST_F(AcceptanceTest, MeasurementEndsWithTheServer) {
  ASSERT_TRUE(Start("upper", kPlan).ok());
  auto end = std::async(std::launch::async, [&] { return calls_.Measure(TrialRequest("upper", 1)); });
  while (server_.arm().hub().Totals().subscribers == 0) std::this_thread::yield();
  server_.Stop();
  const auto measured = end.get();
  ASSERT_FALSE(measured.ok());
  EXPECT_THAT(measured.error().message, HasSubstr("shutting down"));
}

TEST_F(AcceptanceTest, WhatCannotBeIsRefused) {
  const auto code = [](const auto& result) {
    return result.ok() ? ErrorCode::kInternal : result.error().code;
  };
  EXPECT_EQ(code(Start("nothing", kPlan)), ErrorCode::kNotFound);
  EXPECT_EQ(code(Start("upper", "series: [")), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(calls_.Measure(TrialRequest("upper", 1))), ErrorCode::kFailedPrecondition);
  v1::GetAcceptanceRequest get;
  get.set_link("upper");
  EXPECT_EQ(code(calls_.Get(get)), ErrorCode::kFailedPrecondition);
  ASSERT_TRUE(Start("upper", kPlan).ok());
  EXPECT_EQ(code(calls_.Measure(TrialRequest("upper", 7))), ErrorCode::kNotFound);
  v1::MeasureTrialRequest endless = TrialRequest("upper", 1);
  endless.set_duration_s(1e9);
  EXPECT_EQ(code(calls_.Measure(endless)), ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace taclink::server

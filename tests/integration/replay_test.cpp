// Logs that the recorder made, played over the API. Speeds are real time, so nothing here is judged by it.
#include "client/cpp/taclink/replay.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <future>
#include <thread>

#include "client/cpp/taclink/recordings.h"
#include "taclink/v1/recording.grpc.pb.h"
#include "tests/integration/support.h"
#include "tests/support/times.h"
#include "wire/convert.h"

namespace taclink::server {
namespace {

namespace fs = std::filesystem;
using client::Frame;
using client::ReplayMessage;
using client::ReplayOptions;
using client::ReplayReader;
using client::ReplayStatus;
using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Everything that a replay has until it ends.
struct Played {
  std::vector<ReplayStatus> statuses;
  std::vector<Frame> frames;
  std::vector<client::ArmContacts> contacts;
  std::vector<client::Event> events;
  std::vector<client::Arm> arms;
  std::vector<client::ReplayLoss> losses;
  std::vector<int64_t> log_times;

  void operator()(const ReplayStatus& status) { statuses.push_back(status); }
  void operator()(const Frame& frame) { frames.push_back(frame); }
  void operator()(const client::ArmContacts& all) { contacts.push_back(all); }
  void operator()(const client::Event& event) { events.push_back(event); }
  void operator()(const client::Arm& arm) { arms.push_back(arm); }
  void operator()(const client::ReplayLoss& loss) { losses.push_back(loss); }

  std::vector<uint64_t> sequences(const std::string& link) const {
    std::vector<uint64_t> out;
    for (const Frame& frame : frames) {
      if (frame.link == link) out.push_back(frame.sequence);
    }
    return out;
  }
};

Played PlayAll(ReplayReader& reader) {
  Played out;
  while (true) {
    const auto message = reader.Next(kForever);
    if (!message) {
      EXPECT_EQ(message.error().code, ErrorCode::kEndOfData) << message.error().message;
      return out;
    }
    out.log_times.push_back(message->log_utc_ns);
    std::visit(out, message->content);
  }
}

/// The next message of a kind; all others are passed over.
template <typename T>
T NextOf(ReplayReader& reader) {
  while (true) {
    const auto message = reader.Next(kForever);
    EXPECT_TRUE(message.ok()) << message.error().message;
    if (!message) return T();
    if (const T* content = std::get_if<T>(&message->content)) return *content;
  }
}

class ReplayTest : public ::testing::Test {
 protected:
  ~ReplayTest() override { fs::remove_all(folder_); }

  void Publish(size_t link, uint64_t sequence) {
    auto state = std::make_shared<LinkState>();
    FillTestState(link, sequence, *state);
    state->times.exposure_monotonic_ns = state->times.published_ns = server_.clock().MonotonicNs();
    state->times.exposure_utc_ns = server_.clock().UtcNs();
    server_.arm().hub().Publish(link, std::move(state));
  }
  /// Frames 1 to `frames` of "upper" every 10 ms, of "lower" each tenth of them.
  std::string Record(uint64_t frames) {
    const auto started = recordings_.Start({});
    EXPECT_TRUE(started.ok()) << started.error().message;
    for (uint64_t i = 1; i <= frames; ++i) {
      Publish(0, i);
      for (const Detail detail : kAllDetails)
        live_[Index(detail)].push_back(*server_.arm().hub().Latest(0)->Encoded(detail));
      if (i % 10 == 0) Publish(1, i);
      server_.clock().Advance(milliseconds(10));
    }
    const auto stopped = recordings_.Stop();
    EXPECT_TRUE(stopped.ok() && stopped->frames == frames + frames / 10);
    return stopped->log;
  }
  std::unique_ptr<ReplayReader> Play(const ReplayOptions& options) {
    auto reader = recordings_.Replay(options);
    EXPECT_TRUE(reader.ok()) << reader.error().message;
    return reader.ok() ? std::move(*reader) : nullptr;
  }
  /// gRPC tells a client of an end before the server forgets the call.
  void WaitForNoStreams() {
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    while (server_.server().streams() > 0 && std::chrono::steady_clock::now() < give_up)
      std::this_thread::sleep_for(milliseconds(1));
    EXPECT_EQ(server_.server().streams(), 0u);
  }
  ErrorCode Refusal(const ReplayOptions& options) {
    WaitForNoStreams();
    auto reader = recordings_.Replay(options);
    EXPECT_FALSE(reader.ok());
    return reader.error().code;
  }

  const std::string folder_ = NewFolder("replay");
  TestServer server_{TestLimits(), nullptr, {}, {.folder = folder_}};
  client::Client client_ = server_.Connect();
  client::Recordings recordings_ = client_.RecordingCalls();
  /// Frames of "upper", as they were sent at each level of detail.
  std::array<std::vector<std::string>, kDetailCount> live_;
};

TEST_F(ReplayTest, FramesAreThoseThatWereSent) {
  const std::string log = Record(40);
  auto stub = v1::RecordingService::NewStub(server_.server().InProcessChannel());
  for (const Detail detail : kAllDetails) {
    v1::ReplayRequest request;
    request.set_log(log);
    request.add_links("upper");
    request.set_detail(wire::ToWire(detail));
    grpc::ClientContext context;
    const auto reader = stub->Replay(&context, request);
    v1::ReplayResponse response;
    size_t frames = 0;
    while (reader->Read(&response)) {
      if (!response.has_frame()) continue;
      EXPECT_TRUE(response.frame().replayed());
      response.mutable_frame()->clear_replayed();
      EXPECT_EQ(response.frame().SerializeAsString(), live_[Index(detail)].at(frames++));
    }
    EXPECT_EQ(frames, 40u);
    EXPECT_TRUE(reader->Finish().ok());
  }
}

TEST_F(ReplayTest, AllThatTheLogHoldsComesInOrder) {
  const std::string log = Record(40);
  const auto reader = Play({.log = log, .speed = 0});
  const Played played = PlayAll(*reader);
  EXPECT_EQ(played.sequences("upper").size(), 40u);
  EXPECT_THAT(played.sequences("lower"), ElementsAre(10, 20, 30, 40));
  EXPECT_TRUE(std::is_sorted(played.log_times.begin() + 1, played.log_times.end() - 1));
  EXPECT_GE(played.contacts.size(), 1u);
  EXPECT_GE(played.arms.size(), 1u);
  EXPECT_THAT(played.losses, IsEmpty());
  EXPECT_TRUE(played.frames[0].replayed);
  EXPECT_FALSE(played.frames[0].latency_s());
  EXPECT_EQ(played.frames[0].positions_m.size(), 256u);
  ASSERT_GE(played.statuses.size(), 2u);
  EXPECT_FALSE(played.statuses.front().ended);
  const ReplayStatus& last = played.statuses.back();
  EXPECT_TRUE(last.ended);
  EXPECT_EQ(last.position_utc_ns, last.to_utc_ns);
  EXPECT_EQ(last.damaged, 0u);
}

TEST_F(ReplayTest, OnlyWhatWasAskedFor) {
  const std::string log = Record(40);
  const auto whole = NextOf<ReplayStatus>(*Play({.log = log, .speed = 0}));
  const auto reader = Play({.log = log,
                            .links = {"upper"},
                            .detail = client::Detail::kContacts,
                            .from_utc_ns = whole.from_utc_ns + 95 * kMs,
                            .to_utc_ns = whole.from_utc_ns + 205 * kMs,
                            .speed = 0,
                            .events = false,
                            .contacts = false,
                            .arm = false});
  const Played played = PlayAll(*reader);
  const auto upper = played.sequences("upper");
  EXPECT_EQ(upper.size(), 11u);
  EXPECT_EQ(played.frames.size(), 11u);
  EXPECT_THAT(played.frames[0].positions_m, IsEmpty());
  EXPECT_EQ(played.frames[0].contacts.size(), 1u);
  EXPECT_EQ(played.events.size() + played.contacts.size() + played.arms.size(), 0u);
}

TEST_F(ReplayTest, WhatCannotBePlayedIsRefused) {
  const std::string log = Record(10);
  EXPECT_EQ(Refusal({.log = "none.mcap"}), ErrorCode::kNotFound);
  EXPECT_EQ(Refusal({.log = "../" + log}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(Refusal({.log = log, .links = {"nose"}}), ErrorCode::kNotFound);
  EXPECT_EQ(Refusal({.log = log, .speed = 101}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(Refusal({.log = log, .speed = -1}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(Refusal({.log = log, .from_utc_ns = 2, .to_utc_ns = 1}), ErrorCode::kInvalidArgument);
  std::ofstream(folder_ + "/text.mcap") << "this is no log at all";
  EXPECT_EQ(Refusal({.log = "text.mcap"}), ErrorCode::kInternal) << "DATA_LOSS";
}

TEST_F(ReplayTest, OrdersAreCarriedOut) {
  const std::string log = Record(200);
  const auto reader = Play({.log = log,
                            .links = {"upper"},
                            .speed = 1,
                            .paused = true,
                            .events = false,
                            .contacts = false,
                            .arm = false});
  const auto first = NextOf<ReplayStatus>(*reader);
  EXPECT_TRUE(first.paused);
  EXPECT_EQ(first.position_utc_ns, first.from_utc_ns);
  EXPECT_EQ(reader->SetSpeed(1000).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(reader->Step(0).error().code, ErrorCode::kInvalidArgument);

  ASSERT_TRUE(reader->Step(3).ok());
  for (uint64_t i = 1; i <= 3; ++i) EXPECT_EQ(NextOf<Frame>(*reader).sequence, i);

  ASSERT_TRUE(reader->Seek(first.from_utc_ns + 1005 * kMs).ok());
  auto status = NextOf<ReplayStatus>(*reader);
  while (status.position_utc_ns < first.from_utc_ns + 1005 * kMs) status = NextOf<ReplayStatus>(*reader);
  EXPECT_TRUE(status.paused);
  const uint64_t shown = NextOf<Frame>(*reader).sequence;
  EXPECT_NEAR(static_cast<double>(shown), 101, 1) << "the newest before that place";

  ASSERT_TRUE(reader->SetSpeed(0).ok());
  ASSERT_TRUE(reader->Resume().ok());
  for (uint64_t i = shown + 1; i <= 200; ++i) EXPECT_EQ(NextOf<Frame>(*reader).sequence, i);
}

TEST_F(ReplayTest, ARangeIsPlayedAgainAndAgain) {
  const std::string log = Record(20);
  const auto reader = Play({.log = log,
                            .links = {"upper"},
                            .speed = 0,
                            .loop = true,
                            .events = false,
                            .contacts = false,
                            .arm = false});
  for (int round = 0; round < 3; ++round) {
    for (uint64_t i = 1; i <= 20; ++i) EXPECT_EQ(NextOf<Frame>(*reader).sequence, i);
    auto status = NextOf<ReplayStatus>(*reader);
    EXPECT_EQ(status.loops, static_cast<uint64_t>(round + 1));
  }
  ASSERT_TRUE(reader->SetLoop(false).ok());
  EXPECT_TRUE(PlayAll(*reader).statuses.back().ended);
}

TEST_F(ReplayTest, PlayersAreSteeredByTheirIdOnly) {
  const std::string log = Record(20);
  auto stub = v1::RecordingService::NewStub(server_.server().InProcessChannel());
  const auto order = [&](const v1::ControlReplayRequest& request) {
    grpc::ClientContext context;
    v1::ControlReplayResponse response;
    return stub->ControlReplay(&context, request, &response).error_code();
  };
  v1::ControlReplayRequest request;
  request.set_pause(true);
  EXPECT_EQ(order(request), grpc::StatusCode::NOT_FOUND);
  request.set_player("0123456789abcdef0123456789abcdef");
  EXPECT_EQ(order(request), grpc::StatusCode::NOT_FOUND);

  v1::ReplayRequest play;
  play.set_log(log);
  play.set_paused(true);
  std::vector<std::string> ids;
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ReplayResponse>>> readers;
  for (int i = 0; i < 2; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    readers.push_back(stub->Replay(contexts.back().get(), play));
    v1::ReplayResponse response;
    ASSERT_TRUE(readers.back()->Read(&response));
    ids.push_back(response.status().player());
    EXPECT_EQ(ids.back().size(), 32u);
  }
  EXPECT_NE(ids[0], ids[1]);
  request.set_player(ids[1]);
  request.clear_action();
  EXPECT_EQ(order(request), grpc::StatusCode::INVALID_ARGUMENT);
  request.set_step(1);
  EXPECT_EQ(order(request), grpc::StatusCode::OK);
  v1::ReplayResponse response;
  while (!response.has_frame()) ASSERT_TRUE(readers[1]->Read(&response));
  contexts[0]->TryCancel();
  contexts[1]->TryCancel();
  for (const auto& reader : readers) {
    while (reader->Read(&response)) {
    }
    EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  }
  const auto give_up = std::chrono::steady_clock::now() + kForever;
  while (order(request) != grpc::StatusCode::NOT_FOUND && std::chrono::steady_clock::now() < give_up)
    std::this_thread::sleep_for(milliseconds(5));
  EXPECT_EQ(order(request), grpc::StatusCode::NOT_FOUND) << "its call has ended";
}

TEST_F(ReplayTest, TwoPlayersAtOnceGoTheirOwnWays) {
  const std::string log = Record(60);
  const auto slow = Play({.log = log, .links = {"upper"}, .speed = 4});
  const auto fast = Play({.log = log, .links = {"lower"}, .speed = 0});
  auto all = std::async(std::launch::async, [&] { return PlayAll(*slow); });
  EXPECT_THAT(PlayAll(*fast).sequences("lower"), ElementsAre(10, 20, 30, 40, 50, 60));
  EXPECT_EQ(all.get().sequences("upper").size(), 60u);
}

TEST_F(ReplayTest, AClientThatVanishesLeavesNothingBehind) {
  const std::string log = Record(400);
  for (const double speed : {0.0, 1.0, 0.1}) {
    auto reader = Play({.log = log, .speed = speed, .loop = true});
    NextOf<Frame>(*reader);
    reader.reset();
  }
  WaitForNoStreams();
}

TEST_F(ReplayTest, AClientThatDoesNotReadSlowsItAndLosesNothing) {
  const std::string log = Record(400);
  const auto reader =
      Play({.log = log, .links = {"upper"}, .speed = 0, .events = false, .contacts = false, .arm = false});
  NextOf<Frame>(*reader);
  std::this_thread::sleep_for(milliseconds(200));  // the transport's buffers fill
  const auto rest = PlayAll(*reader).sequences("upper");
  ASSERT_EQ(rest.size(), 399u);
  for (size_t i = 0; i < rest.size(); ++i) EXPECT_EQ(rest[i], i + 2);
}

TEST_F(ReplayTest, AServerThatStopsEndsIt) {
  const std::string log = Record(20);
  const auto reader = Play({.log = log, .speed = 1, .loop = true});
  NextOf<Frame>(*reader);
  std::thread stopper([&] { server_.Stop(); });
  while (true) {
    const auto message = reader->Next(kForever);
    if (message) continue;
    EXPECT_EQ(message.error().code, ErrorCode::kUnavailable) << message.error().message;
    break;
  }
  stopper.join();
}

// How far from its due time each frame comes at speed 1. Printed, for no machine is always idle.
TEST_F(ReplayTest, TellsItsTiming) {
  const std::string log = Record(200);
  const auto reader =
      Play({.log = log, .links = {"upper"}, .speed = 1, .events = false, .contacts = false, .arm = false});
  std::vector<double> offsets_ms;
  double told_ms = 0;
  while (true) {
    const auto message = reader->Next(kForever);
    if (!message) break;
    const double now_ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
            .count();
    if (const auto* status = std::get_if<ReplayStatus>(&message->content))
      told_ms = std::max(told_ms, status->lateness_s * 1e3);
    if (std::holds_alternative<Frame>(message->content))
      offsets_ms.push_back(now_ms - static_cast<double>(message->log_utc_ns) * 1e-6);
  }
  ASSERT_EQ(offsets_ms.size(), 200u);
  std::sort(offsets_ms.begin(), offsets_ms.end());
  const double median = offsets_ms[100];
  std::vector<double> errors;
  for (const double offset : offsets_ms) errors.push_back(std::abs(offset - median));
  std::sort(errors.begin(), errors.end());
  std::printf(
      "speed 1: error against the median: p50 %.3f ms, p99 %.3f ms, worst %.3f ms; the server told %.3f ms\n",
      errors[100], errors[198], errors[199], told_ms);
}

}  // namespace
}  // namespace taclink::server

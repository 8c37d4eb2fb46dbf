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
using client::ReplayReader;
using std::chrono::milliseconds;
using ::testing::ElementsAre;

/// Everything that a replay has until it ends.
struct Played {
  std::vector<v1::ReplayStatus> statuses;
  std::vector<v1::LinkFrame> frames;
  std::vector<v1::StreamContactsResponse> contacts;
  std::vector<v1::Event> events;
  std::vector<v1::Arm> arms;
  std::vector<v1::RecordingLoss> losses;
  std::vector<int64_t> log_times;

  void Take(const v1::ReplayResponse& message) {
    log_times.push_back(message.log_utc_ns());
    if (message.has_status()) statuses.push_back(message.status());
    if (message.has_frame()) frames.push_back(message.frame());
    if (message.has_contacts()) contacts.push_back(message.contacts());
    if (message.has_event()) events.push_back(message.event());
    if (message.has_arm()) arms.push_back(message.arm());
    if (message.has_loss()) losses.push_back(message.loss());
  }

  std::vector<uint64_t> sequences(const std::string& link) const {
    std::vector<uint64_t> out;
    for (const v1::LinkFrame& frame : frames) {
      if (frame.link() == link) out.push_back(frame.sequence());
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
    out.Take(*message);
  }
}

/// The next message with `wanted`; all others are passed over.
v1::ReplayResponse NextWith(ReplayReader& reader, v1::ReplayResponse::MessageCase wanted) {
  while (true) {
    const auto message = reader.Next(kForever);
    EXPECT_TRUE(message.ok()) << message.error().message;
    if (!message || message->message_case() == wanted) return message ? *message : v1::ReplayResponse();
  }
}
v1::ReplayStatus NextStatus(ReplayReader& reader) {
  return NextWith(reader, v1::ReplayResponse::kStatus).status();
}
uint64_t NextSequence(ReplayReader& reader) {
  return NextWith(reader, v1::ReplayResponse::kFrame).frame().sequence();
}

/// All of a log, as fast as it is read.
v1::ReplayRequest WholeOf(const std::string& log, double speed = 0) {
  v1::ReplayRequest request;
  request.set_log(log);
  request.set_detail(v1::DETAIL_FULL);
  request.set_speed(speed);
  return request;
}
v1::ReplayRequest OfLink(const std::string& link, const std::string& log, double speed = 0) {
  v1::ReplayRequest request = WholeOf(log, speed);
  request.add_links(link);
  return request;
}
/// Only the frames of "upper".
v1::ReplayRequest FramesOf(const std::string& log, double speed = 0) {
  v1::ReplayRequest request = OfLink("upper", log, speed);
  request.set_without_events(true);
  request.set_without_contacts(true);
  request.set_without_arm(true);
  return request;
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
    EXPECT_TRUE(stopped.ok() && stopped->frames() == frames + frames / 10);
    return stopped->log();
  }
  std::unique_ptr<ReplayReader> Play(const v1::ReplayRequest& request) {
    auto reader = recordings_.Replay(request);
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
  ErrorCode Refusal(const v1::ReplayRequest& request) {
    WaitForNoStreams();
    auto reader = recordings_.Replay(request);
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
  const auto reader = Play(WholeOf(log));
  const Played played = PlayAll(*reader);
  EXPECT_EQ(played.sequences("upper").size(), 40u);
  EXPECT_THAT(played.sequences("lower"), ElementsAre(10, 20, 30, 40));
  EXPECT_TRUE(std::is_sorted(played.log_times.begin() + 1, played.log_times.end() - 1));
  EXPECT_GE(played.contacts.size(), 1u);
  EXPECT_GE(played.arms.size(), 1u);
  EXPECT_TRUE(played.losses.empty());
  EXPECT_TRUE(played.frames[0].replayed());
  EXPECT_FALSE(client::LatencyS(played.frames[0]));
  EXPECT_EQ(played.frames[0].positions_m_size(), 3 * 256);
  ASSERT_GE(played.statuses.size(), 2u);
  EXPECT_FALSE(played.statuses.front().ended());
  const v1::ReplayStatus& last = played.statuses.back();
  EXPECT_TRUE(last.ended());
  EXPECT_EQ(last.position_utc_ns(), last.to_utc_ns());
  EXPECT_EQ(last.damaged(), 0u);
}

TEST_F(ReplayTest, OnlyWhatWasAskedFor) {
  const std::string log = Record(40);
  const int64_t begin_utc_ns = NextStatus(*Play(WholeOf(log))).from_utc_ns();
  auto request = FramesOf(log);
  request.set_detail(v1::DETAIL_CONTACTS);
  request.set_from_utc_ns(begin_utc_ns + 95 * kMs);
  request.set_to_utc_ns(begin_utc_ns + 205 * kMs);
  const auto reader = Play(request);
  const Played played = PlayAll(*reader);
  const auto upper = played.sequences("upper");
  EXPECT_EQ(upper.size(), 11u);
  EXPECT_EQ(played.frames.size(), 11u);
  EXPECT_EQ(played.frames[0].positions_m_size(), 0);
  EXPECT_EQ(played.frames[0].contacts_size(), 1);
  EXPECT_EQ(played.events.size() + played.contacts.size() + played.arms.size(), 0u);
}

TEST_F(ReplayTest, WhatCannotBePlayedIsRefused) {
  const std::string log = Record(10);
  EXPECT_EQ(Refusal(WholeOf("none.mcap")), ErrorCode::kNotFound);
  EXPECT_EQ(Refusal(WholeOf("../" + log)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(Refusal(OfLink("nose", log)), ErrorCode::kNotFound);
  EXPECT_EQ(Refusal(WholeOf(log, 101)), ErrorCode::kInvalidArgument);
  EXPECT_EQ(Refusal(WholeOf(log, -1)), ErrorCode::kInvalidArgument);
  auto backwards = WholeOf(log);
  backwards.set_from_utc_ns(2);
  backwards.set_to_utc_ns(1);
  EXPECT_EQ(Refusal(backwards), ErrorCode::kInvalidArgument);
  std::ofstream(folder_ + "/text.mcap") << "this is no log at all";
  EXPECT_EQ(Refusal(WholeOf("text.mcap")), ErrorCode::kInternal) << "DATA_LOSS";
}

TEST_F(ReplayTest, OrdersAreCarriedOut) {
  const std::string log = Record(200);
  auto request = FramesOf(log, 1);
  request.set_paused(true);
  const auto reader = Play(request);
  const auto first = NextStatus(*reader);
  EXPECT_TRUE(first.paused());
  EXPECT_EQ(first.position_utc_ns(), first.from_utc_ns());
  EXPECT_EQ(reader->SetSpeed(1000).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(reader->Step(0).error().code, ErrorCode::kInvalidArgument);

  ASSERT_TRUE(reader->Step(3).ok());
  for (uint64_t i = 1; i <= 3; ++i) EXPECT_EQ(NextSequence(*reader), i);

  ASSERT_TRUE(reader->Seek(first.from_utc_ns() + 1005 * kMs).ok());
  auto status = NextStatus(*reader);
  while (status.position_utc_ns() < first.from_utc_ns() + 1005 * kMs) status = NextStatus(*reader);
  EXPECT_TRUE(status.paused());
  const uint64_t shown = NextSequence(*reader);
  EXPECT_NEAR(static_cast<double>(shown), 101, 1) << "the newest before that place";

  ASSERT_TRUE(reader->SetSpeed(0).ok());
  ASSERT_TRUE(reader->Resume().ok());
  for (uint64_t i = shown + 1; i <= 200; ++i) EXPECT_EQ(NextSequence(*reader), i);
}

TEST_F(ReplayTest, ARangeIsPlayedAgainAndAgain) {
  const std::string log = Record(20);
  auto request = FramesOf(log);
  request.set_loop(true);
  const auto reader = Play(request);
  for (int round = 0; round < 3; ++round) {
    for (uint64_t i = 1; i <= 20; ++i) EXPECT_EQ(NextSequence(*reader), i);
    EXPECT_EQ(NextStatus(*reader).loops(), static_cast<uint64_t>(round + 1));
  }
  ASSERT_TRUE(reader->SetLoop(false).ok());
  EXPECT_TRUE(PlayAll(*reader).statuses.back().ended());
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
  const auto slow = Play(OfLink("upper", log, 4));
  const auto fast = Play(OfLink("lower", log));
  auto all = std::async(std::launch::async, [&] { return PlayAll(*slow); });
  EXPECT_THAT(PlayAll(*fast).sequences("lower"), ElementsAre(10, 20, 30, 40, 50, 60));
  EXPECT_EQ(all.get().sequences("upper").size(), 60u);
}

TEST_F(ReplayTest, AClientThatVanishesLeavesNothingBehind) {
  const std::string log = Record(400);
  for (const double speed : {0.0, 1.0, 0.1}) {
    auto request = WholeOf(log, speed);
    request.set_loop(true);
    auto reader = Play(request);
    NextSequence(*reader);
    reader.reset();
  }
  WaitForNoStreams();
}

TEST_F(ReplayTest, AClientThatDoesNotReadSlowsItAndLosesNothing) {
  const std::string log = Record(400);
  const auto reader = Play(FramesOf(log));
  NextSequence(*reader);
  std::this_thread::sleep_for(milliseconds(200));  // the transport's buffers fill
  const auto rest = PlayAll(*reader).sequences("upper");
  ASSERT_EQ(rest.size(), 399u);
  for (size_t i = 0; i < rest.size(); ++i) EXPECT_EQ(rest[i], i + 2);
}

TEST_F(ReplayTest, AServerThatStopsEndsIt) {
  const std::string log = Record(20);
  auto request = WholeOf(log, 1);
  request.set_loop(true);
  const auto reader = Play(request);
  NextSequence(*reader);
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
  const auto reader = Play(FramesOf(log, 1));
  std::vector<double> offsets_ms;
  double told_ms = 0;
  while (true) {
    const auto message = reader->Next(kForever);
    if (!message) break;
    const double now_ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
            .count();
    told_ms = std::max(told_ms, message->status().lateness_s() * 1e3);
    if (message->has_frame())
      offsets_ms.push_back(now_ms - static_cast<double>(message->log_utc_ns()) * 1e-6);
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

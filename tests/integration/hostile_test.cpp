// Clients that are broken, gone or mean; beside them, one that wants every frame and gets it.
#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <condition_variable>
#include <random>

#include "taclink/v1/tactile.grpc.pb.h"
#include "tests/integration/raw_socket.h"
#include "tests/integration/support.h"
#include "tests/support/http2_frames.h"
#include "tests/support/memory.h"
#include "tests/support/paths.h"
#include "tests/support/process.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr double kGrowthMb = 24;  // that noise of the allocator and thread stacks may make

// All waits of the server are patient: they hold for the witness, too, whose threads may not run for seconds.
ServiceLimits PatientLimits() {
  return {.max_streams = 16, .max_streams_per_peer = 16, .queue_messages = 64};
}

ServiceLimits ImpatientLimits() {
  ServiceLimits limits = PatientLimits();
  limits.keepalive = milliseconds(300);
  limits.keepalive_timeout = milliseconds(2000);
  limits.handshake_timeout = milliseconds(1000);
  return limits;
}

/// A call whose answers are read and forgotten.
class ForgetfulCall final : public grpc::ClientReadReactor<v1::StreamFramesResponse> {
 public:
  explicit ForgetfulCall(v1::TactileService::Stub& stub) {
    stub.async()->StreamFrames(&context_, &request_, this);
    StartRead(&response_);
    StartCall();
  }
  void Cancel() { context_.TryCancel(); }
  grpc::StatusCode Wait() {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, kForever, [this] { return done_; }));
    return status_.error_code();
  }

 private:
  void OnReadDone(bool ok) override {
    if (ok) StartRead(&response_);
  }
  void OnDone(const grpc::Status& status) override {
    const std::lock_guard lock(mutex_);
    status_ = status;
    done_ = true;
    changed_.notify_all();
  }

  grpc::ClientContext context_;
  const v1::StreamFramesRequest request_;
  v1::StreamFramesResponse response_;
  std::mutex mutex_;
  std::condition_variable changed_;
  grpc::Status status_;
  bool done_ = false;
};

class Hostile : public ::testing::Test {
 protected:
  // Frames are published one by one, and the witness gets each before the next.
  void Frames(int count) {
    for (int i = 0; i < count; ++i) {
      server_.Publish(0, ++sequence_);
      const auto frame = witness_->Next(kForever);
      ASSERT_TRUE(frame.ok()) << frame.error().message;
      ASSERT_EQ(frame->sequence(), sequence_);
    }
  }
  // `harm` over and over takes no more memory than the first times.
  template <typename F>
  void ExpectFlatMemory(int times, const F& harm) {
    for (int i = 0; i < times; ++i) harm();
    Frames(20);
    const double before_mb = testing::ResidentMb();
    for (int i = 0; i < 2 * times; ++i) harm();
    Frames(20);
    if (!testing::kSanitized) {
      EXPECT_LT(testing::ResidentMb(), before_mb + kGrowthMb);
    }
    EXPECT_EQ(witness_->status().links(0).frames_dropped(), 0u);
  }
  void WaitForStreams(size_t count) { WaitForStreams(server_.server(), count); }
  void WaitForStreams(const RpcServer& server, size_t count) {
    const auto give_up = steady_clock::now() + kForever;
    while (server.streams() != count && steady_clock::now() < give_up) Frames(1);
    EXPECT_EQ(server.streams(), count);
  }
  std::shared_ptr<grpc::Channel> NewChannel() {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
    return grpc::CreateCustomChannel(server_.server().address(), grpc::InsecureChannelCredentials(),
                                     arguments);
  }
  // Another server of the same arm, which closes silent connections soon.
  std::unique_ptr<RpcServer> ImpatientServer() {
    auto server = RpcServer::Start("127.0.0.1:0", server_.arm(), ImpatientLimits());
    EXPECT_TRUE(server.ok()) << server.error().message;
    return std::move(*server);
  }

  TestServer server_{PatientLimits()};
  client::Client client_ = server_.Connect();
  std::unique_ptr<client::FrameReader> witness_ = Stream(client_, Every(v1::DETAIL_FULL));
  uint64_t sequence_ = 0;
};

TEST_F(Hostile, GarbageOnThePort) {
  std::mt19937 random(1);
  ExpectFlatMemory(100, [&] {
    RawSocket socket(server_.server().address());
    ASSERT_TRUE(socket.connected());
    std::string bytes = random() % 2 == 0 ? Http2Preface() : "";
    for (size_t i = random() % 5000; i > 0; --i) bytes += static_cast<char>(random());
    socket.Send(bytes);
    if (random() % 4 == 0) socket.Send("GET / HTTP/1.1\r\nHost: robot\r\n\r\n");
  });
}

// Whole frames, so that any of them may come after any other.
std::vector<std::string> Http2Floods() {
  using namespace taclink::testing;
  const std::string call =
      Frame(Http2Frame::kHeaders, kEndHeaders, 1, CallFields("/taclink.v1.TactileService/GetArm"));
  const std::string zeros(4, '\0');
  return {Frame(Http2Frame::kHeaders, 0, 1, CallFields("/x")) +
              Frame(Http2Frame::kContinuation, 0, 1, Field("a", std::string(100, 'b'))),
          Frame(Http2Frame::kContinuation, 0, 1, Field("a", std::string(100, 'b'))),
          call + Frame(Http2Frame::kReset, 0, 1, zeros),
          call + Frame(Http2Frame::kWindowUpdate, 0, 1, zeros),
          Frame(Http2Frame::kSettings, 0, 0),
          Frame(Http2Frame::kPing, 0, 0, "12345678"),
          Frame(Http2Frame::kPriority, 0, 1, "12345"),
          Frame(Http2Frame::kWindowUpdate, 0, 0, std::string("\0\0\0\1", 4)),
          Frame(Http2Frame::kData, 0, 1)};
}

TEST_F(Hostile, FloodsOfFramesEndTheirConnection) {
  ExpectFlatMemory(2, [&] {
    for (const std::string& flood : Http2Floods()) {
      const RawSocket socket(server_.server().address());
      std::string many;
      while (many.size() < 20'000) many += flood;
      socket.Send(taclink::testing::Preface());
      // What comes after a header block that does not end is none of the other kinds.
      EXPECT_TRUE(socket.Flood(many, size_t{64} << 20)) << flood;
    }
  });
}

TEST_F(Hostile, ConnectionsThatSayNothingAreClosed) {
  const auto impatient = ImpatientServer();
  std::vector<RawSocket> silent, half_open, beside_witness;
  for (int i = 0; i < 100; ++i) {
    beside_witness.emplace_back(server_.server().address());
    silent.emplace_back(impatient->address());
    half_open.emplace_back(impatient->address());
    half_open.back().Send(Http2Preface());
  }
  Frames(50);
  for (const auto& socket : silent) EXPECT_TRUE(socket.WaitForEnd(kForever));     // handshake_timeout
  for (const auto& socket : half_open) EXPECT_TRUE(socket.WaitForEnd(kForever));  // keepalive_timeout
  Frames(50);
}

TEST_F(Hostile, AStoppedProgramIsGivenUp) {
  using taclink::testing::Process;
  const auto impatient = ImpatientServer();
  Process watch({testing::kTaclink, "watch", "--server", impatient->address(), "--json", "--every",
                 "--detail", "full"});
  WaitForStreams(*impatient, 1);
  watch.Signal(SIGSTOP);
  WaitForStreams(*impatient, 0);
}

TEST_F(Hostile, AKilledProgramIsForgotten) {
  using taclink::testing::Process;
  Process watch({testing::kTaclink, "watch", "--server", server_.server().address(), "--json"});
  WaitForStreams(2);
  watch.Signal(SIGKILL);
  WaitForStreams(1);
}

TEST_F(Hostile, ThousandsOfStreamsOnOneConnection) {
  ExpectFlatMemory(2, [&] {
    const auto stub = v1::TactileService::NewStub(NewChannel());
    std::vector<std::unique_ptr<ForgetfulCall>> calls;
    for (int i = 0; i < 1000; ++i) calls.push_back(std::make_unique<ForgetfulCall>(*stub));
    Frames(50);
    for (auto& call : calls) call->Cancel();
    for (auto& call : calls) {
      EXPECT_THAT(call->Wait(),
                  ::testing::AnyOf(grpc::StatusCode::CANCELLED, grpc::StatusCode::RESOURCE_EXHAUSTED));
    }
    WaitForStreams(1);
  });
}

TEST_F(Hostile, ClientsThatComeAndGo) {
  ExpectFlatMemory(60, [&] {
    auto client = server_.Connect();
    WaitForStreams(1);  // the one before has gone
    const auto reader = client.StreamFrames(Every(v1::DETAIL_FULL));
    Frames(2);
    EXPECT_TRUE(reader.ok() && (*reader)->Next(kForever).ok());
  });
  WaitForStreams(1);
}

TEST_F(Hostile, ClientsThatNeverRead) {
  ExpectFlatMemory(2, [&] {
    std::vector<client::Client> clients;
    std::vector<std::unique_ptr<client::FrameReader>> readers;
    for (int i = 0; i < 10; ++i) {
      clients.push_back(server_.Connect());
      readers.push_back(Stream(clients.back(), Every(v1::DETAIL_FULL)));
    }
    Frames(500);
    EXPECT_LE(server_.states_alive(), 64 + 32);
    readers.clear();
    WaitForStreams(1);
  });
}

/// The status of a unary-like call with these bytes as its request.
grpc::StatusCode Send(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                      const std::string& bytes, const std::string& metadata = "") {
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kForever);
  if (!metadata.empty()) context.AddMetadata("nonsense", metadata);
  grpc::CompletionQueue queue;
  grpc::Slice slice(bytes);
  const auto call =
      stub.PrepareUnaryCall(&context, "/taclink.v1.TactileService/" + method, {&slice, 1}, &queue);
  call->StartCall();
  grpc::ByteBuffer answer;
  grpc::Status status;
  call->Finish(&answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  queue.Shutdown();
  while (queue.Next(&tag, &ok)) {
  }
  return status.error_code();
}

TEST_F(Hostile, MalformedAndHugeMessages) {
  const auto channel = NewChannel();
  std::mt19937 random(2);
  ExpectFlatMemory(100, [&] {
    std::string bytes = "\x0a\xff\xff\xff\x7f";  // a link's name of 268 million bytes that do not follow
    for (size_t i = random() % 300; i > 0; --i) bytes += static_cast<char>(random());
    EXPECT_EQ(Send(channel, "StreamFrames", bytes), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_NE(Send(channel, "Calibrate", bytes), grpc::StatusCode::OK);
    EXPECT_EQ(Send(channel, "Dance", bytes), grpc::StatusCode::UNIMPLEMENTED);
  });
  const std::string huge(size_t{1} << 20, 'x');  // larger ones only make this client's memory noisy
  ExpectFlatMemory(30, [&] {
    EXPECT_EQ(Send(channel, "StreamFrames", huge), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_NE(Send(NewChannel(), "GetArm", "", std::string(100'000, 'm')), grpc::StatusCode::OK);
  });
}

}  // namespace
}  // namespace taclink::server

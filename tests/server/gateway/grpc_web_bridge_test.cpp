// The API as a browser calls it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "server/gateway/grpc_web.h"
#include "taclink/v1/recording.pb.h"
#include "taclink/v1/tactile.pb.h"
#include "tests/server/gateway/support.h"

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kService = "/taclink.v1.TactileService/";

std::string Post(const std::string& method, const std::string& body,
                 const std::string& type = "application/grpc-web+proto", const std::string& more = "") {
  return "POST " + (method.starts_with("/") ? method : kService + method) +
         " HTTP/1.1\r\nHost: localhost\r\nContent-Type: " + type + "\r\n" + more +
         "Content-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
}

std::string Post(const std::string& method, const google::protobuf::Message& request) {
  return Post(method, EncodeMessage(WebFormat::kBinary, request.SerializeAsString()));
}

/// The frames of a body in gRPC-Web's binary form.
struct WebBody {
  explicit WebBody(std::string body) {
    while (body.size() >= 5) {
      size_t length = 0;
      for (size_t i = 1; i < 5; ++i) length = length << 8 | static_cast<uint8_t>(body[i]);
      if (body.size() < 5 + length) break;
      const std::string payload = body.substr(5, length);
      (static_cast<uint8_t>(body[0]) == 0x80 ? trailers : messages.emplace_back()) = payload;
      body.erase(0, 5 + length);
    }
    EXPECT_TRUE(body.empty());
  }
  std::vector<std::string> messages;
  std::string trailers;
};

v1::StreamFramesResponse Parsed(const std::string& chunk) {
  const WebBody body(chunk);
  v1::StreamFramesResponse response;
  EXPECT_EQ(body.messages.size(), 1u);
  EXPECT_TRUE(!body.messages.empty() && response.ParseFromString(body.messages[0]));
  return response;
}

TEST(GrpcWebBridge, Unary) {
  TestGateway gateway;
  const RawResponse response = Ask(gateway.address(), Post("GetArm", v1::GetArmRequest()));
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.headers.at("content-type"), "application/grpc-web+proto");
  const WebBody body(response.body);
  EXPECT_EQ(body.trailers, "grpc-status: 0\r\n");
  ASSERT_EQ(body.messages.size(), 1u);
  v1::GetArmResponse arm;
  ASSERT_TRUE(arm.ParseFromString(body.messages[0]));
  ASSERT_EQ(arm.arm().links_size(), 2);
  EXPECT_EQ(arm.arm().links(1).name(), "lower");
}

TEST(GrpcWebBridge, TextForm) {
  TestGateway gateway;
  const RawResponse response = Ask(
      gateway.address(), Post("GetArm", EncodeMessage(WebFormat::kText, ""), "application/grpc-web-text"));
  EXPECT_EQ(response.headers.at("content-type"), "application/grpc-web-text+proto");
  const auto bytes = DecodeBase64(response.body);
  ASSERT_TRUE(bytes.ok());
  const WebBody body(*bytes);
  EXPECT_EQ(body.trailers, "grpc-status: 0\r\n");
  EXPECT_EQ(body.messages.size(), 1u);
}

TEST(GrpcWebBridge, ErrorsComeAsTrailers) {
  TestGateway gateway;
  const auto trailers = [&](const std::string& post) {
    return WebBody(Ask(gateway.address(), post).body).trailers;
  };
  v1::CalibrateRequest wrong;
  wrong.set_link("no such");
  EXPECT_EQ(trailers(Post("Calibrate", wrong)),
            "grpc-status: 5\r\ngrpc-message: no link 'no such'; this arm has upper, lower\r\n");
  EXPECT_THAT(trailers(Post("NoSuchMethod", EncodeMessage(WebFormat::kBinary, ""))),
              HasSubstr("grpc-status: 12"));
  EXPECT_THAT(trailers(Post("StreamFrames", EncodeMessage(WebFormat::kBinary, "\x0a\xff"))),
              HasSubstr("grpc-status: 3"));
  EXPECT_THAT(trailers(Post("GetArm", "abc")),
              HasSubstr("grpc-status: 3\r\ngrpc-message: the gRPC-Web body ends"));
  EXPECT_THAT(trailers(Post("GetArm", std::string("\1\0\0\0\0", 5))), HasSubstr("grpc-status: 12"));
  EXPECT_THAT(trailers(Post("GetArm", EncodeMessage(WebFormat::kBinary, ""), "application/grpc-web",
                            "grpc-timeout: soon\r\n")),
              HasSubstr("grpc-status: 3"));
}

TEST(GrpcWebBridge, OtherBodiesAreNotTaken) {
  TestGateway gateway;
  EXPECT_EQ(Ask(gateway.address(), Post("GetArm", "{}", "application/json")).status, 405);
  EXPECT_EQ(Ask(gateway.address(), Post("/not/a/method", "")).status, 405);
}

TEST(GrpcWebBridge, ADeadlineEndsAStream) {
  TestGateway gateway;
  const RawResponse response =
      Ask(gateway.address(), Post("StreamFrames", EncodeMessage(WebFormat::kBinary, ""),
                                  "application/grpc-web", "grpc-timeout: 50m\r\n"));
  EXPECT_THAT(WebBody(response.body).trailers, HasSubstr("grpc-status: 4"));
}

// As nginx asks unless it is told otherwise: the stream ends with the connection.
TEST(GrpcWebBridge, Http10GetsPlainBodies) {
  TestGateway gateway;
  RawHttp proxy(gateway.address());
  const std::string request = EncodeMessage(WebFormat::kBinary, "");
  proxy.Send(std::string("POST ") + kService + "GetArm HTTP/1.0\r\nHost: 127.0.0.1:8080\r\n" +
             "Connection: close\r\nContent-Type: application/grpc-web\r\nContent-Length: " +
             std::to_string(request.size()) + "\r\n\r\n" + request);
  const RawResponse head = proxy.ReadHead();
  EXPECT_EQ(head.status, 200);
  EXPECT_FALSE(head.headers.contains("transfer-encoding"));
  EXPECT_FALSE(head.headers.contains("content-length"));
  EXPECT_EQ(head.headers.at("connection"), "close");
  EXPECT_EQ(head.headers.at("x-accel-buffering"), "no");
  const WebBody body(proxy.ReadToEnd());
  EXPECT_EQ(body.messages.size(), 1u);
  EXPECT_EQ(body.trailers, "grpc-status: 0\r\n");
}

TEST(GrpcWebBridge, FramesStreamUntilTheServerEnds) {
  TestGateway gateway;
  RawHttp browser(gateway.address());
  v1::StreamFramesRequest request;
  request.set_delivery(v1::DELIVERY_EVERY);
  browser.Send(Post("StreamFrames", request));
  EXPECT_EQ(browser.ReadHead().status, 200);
  EXPECT_TRUE(Parsed(browser.ReadChunk().value_or("")).has_status());
  for (uint64_t sequence = 1; sequence <= 5; ++sequence) {
    gateway.server().Publish(0, sequence);
    EXPECT_EQ(Parsed(browser.ReadChunk().value_or("")).frame().sequence(), sequence);
  }
  EXPECT_EQ(gateway.counts().calls, 1u);
  gateway.server().server().Shutdown("the test is over", kForever);
  std::string rest;
  while (const auto chunk = browser.ReadChunk()) rest += *chunk;
  const WebBody last(rest);
  EXPECT_EQ(last.trailers, "grpc-status: 14\r\ngrpc-message: the test is over\r\n");
  ASSERT_EQ(last.messages.size(), 1u);
  v1::StreamFramesResponse end;
  ASSERT_TRUE(end.ParseFromString(last.messages[0]));
  EXPECT_EQ(end.status().end_reason(), "the test is over");
  browser.Send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(browser.Read().body, "ok\n") << "the connection is still good";
}

// A browser's abort closes the connection; the server notices though it has nothing to send.
TEST(GrpcWebBridge, ALogIsPlayedAndSteered) {
  const std::string folder = ::testing::TempDir() + "bridge." + std::to_string(::getpid());
  TestGateway gateway({}, std::make_shared<const Security>(), {.folder = folder});
  Recorder& recorder = gateway.server().recorder();
  ASSERT_TRUE(recorder.Start({}, "test").ok());
  for (uint64_t sequence = 1; sequence <= 5; ++sequence) gateway.server().Publish(0, sequence, sequence);
  const auto recorded = recorder.Stop("test");
  ASSERT_TRUE(recorded.ok() && recorded->frames() == 5);

  const std::string service = "/taclink.v1.RecordingService/";
  v1::ReplayRequest request;
  request.set_log(recorded->log());
  request.set_paused(true);
  request.set_without_arm(true);
  request.set_without_contacts(true);
  RawHttp browser(gateway.address());
  browser.Send(Post(service + "Replay", EncodeMessage(WebFormat::kBinary, request.SerializeAsString())));
  EXPECT_EQ(browser.ReadHead().status, 200);
  v1::ReplayResponse first;
  ASSERT_TRUE(first.ParseFromString(WebBody(browser.ReadChunk().value_or("")).messages.at(0)));
  EXPECT_TRUE(first.status().paused());
  v1::ControlReplayRequest order;
  order.set_player(first.status().player());
  order.set_pause(false);
  const auto answer =
      Ask(gateway.address(),
          Post(service + "ControlReplay", EncodeMessage(WebFormat::kBinary, order.SerializeAsString())));
  EXPECT_EQ(WebBody(answer.body).trailers, "grpc-status: 0\r\n");
  std::string rest;
  while (const auto chunk = browser.ReadChunk()) rest += *chunk;
  const WebBody body(rest);
  std::vector<uint64_t> frames;
  for (const std::string& message : body.messages) {
    v1::ReplayResponse response;
    EXPECT_TRUE(response.ParseFromString(message));
    if (response.has_frame()) frames.push_back(response.frame().sequence());
  }
  EXPECT_THAT(frames, ElementsAre(1, 2, 3, 4, 5));
  EXPECT_EQ(body.trailers, "grpc-status: 0\r\n");
  std::filesystem::remove_all(folder);
}

TEST(GrpcWebBridge, AGoneBrowserEndsItsStream) {
  TestGateway gateway;
  for (const bool half : {true, false}) {
    RawHttp browser(gateway.address());
    browser.Send(Post("StreamFrames", v1::StreamFramesRequest()));
    browser.ReadHead();
    EXPECT_TRUE(Parsed(browser.ReadChunk().value_or("")).has_status());
    EXPECT_EQ(gateway.server().server().streams(), 1u);
    if (half) {
      browser.EndWriting();
    } else {
      browser.Close();
    }
    const auto deadline = std::chrono::steady_clock::now() + kForever;
    while (gateway.server().server().streams() > 0 && std::chrono::steady_clock::now() < deadline)
      std::this_thread::yield();
    EXPECT_EQ(gateway.server().server().streams(), 0u);
  }
}

// What a browser that does not read misses, the hub drops: nothing piles up in between.
TEST(GrpcWebBridge, ASlowBrowserGetsTheNewest) {
  TestGateway gateway;
  RawHttp browser(gateway.address());
  v1::StreamFramesRequest request;
  request.set_detail(v1::DETAIL_FULL);
  browser.Send(Post("StreamFrames", request));
  browser.ReadHead();
  EXPECT_TRUE(Parsed(browser.ReadChunk().value_or("")).has_status());
  constexpr uint64_t kFrames = 2000;  // more than sockets and gRPC hold
  for (uint64_t sequence = 1; sequence <= kFrames; ++sequence) gateway.server().Publish(0, sequence);
  uint64_t taken = 0, newest = 0;
  while (newest < kFrames) {
    const auto chunk = browser.ReadChunk();
    ASSERT_TRUE(chunk.has_value());
    const auto response = Parsed(*chunk);
    if (!response.has_frame()) continue;
    EXPECT_GT(response.frame().sequence(), newest);
    newest = response.frame().sequence();
    ++taken;
  }
  EXPECT_LT(taken, kFrames);
  EXPECT_LT(gateway.server().states_alive(), 10);
}

TEST(GrpcWebBridge, TheGatewayMayEndUnderOpenStreams) {
  auto gateway = std::make_unique<TestGateway>();
  RawHttp browser(gateway->address()), waiting(gateway->address());
  browser.Send(Post("StreamFrames", v1::StreamFramesRequest()));
  EXPECT_EQ(browser.ReadHead().status, 200);
  EXPECT_TRUE(browser.ReadChunk().has_value());
  gateway.reset();
  browser.ReadToEnd();
  EXPECT_EQ(waiting.ReadToEnd(), "");
}

}  // namespace
}  // namespace taclink::server

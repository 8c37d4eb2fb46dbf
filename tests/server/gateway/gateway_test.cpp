// HTTP as a hostile or clumsy client sees it.
#include "server/gateway/gateway.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "server/gateway/setup.h"
#include "tests/server/gateway/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(Gateway, ServesTheBuiltInPage) {
  TestGateway gateway;
  const RawResponse page = Get(gateway.address(), "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.headers.at("content-type"), "text/html; charset=utf-8");
  EXPECT_EQ(page.headers.at("cache-control"), "no-cache");
  EXPECT_EQ(page.headers.at("x-content-type-options"), "nosniff");
  EXPECT_THAT(page.body, HasSubstr("<title>TacLINK</title>"));
  EXPECT_THAT(page.body, Not(HasSubstr("=\"/"))) << "a proxy may serve it below a path of its own";
  EXPECT_FALSE(page.headers.contains("access-control-allow-origin"));
  EXPECT_EQ(Get(gateway.address(), "/index.html").body, page.body);
  const RawResponse again = Get(gateway.address(), "/", "If-None-Match: " + page.headers.at("etag") + "\r\n");
  EXPECT_EQ(again.status, 304);
  EXPECT_TRUE(again.body.empty());
  EXPECT_EQ(Get(gateway.address(), "/no-such.js").status, 404);
  const bool is_dashboard = page.body.find("index.js") != std::string::npos;
  EXPECT_EQ(Get(gateway.address(), "/licenses.txt").status, is_dashboard ? 200 : 404)
      << "the licenses of what the page contains";
}

class WebRoot {
 public:
  WebRoot() : folder_(std::filesystem::temp_directory_path() / ("taclink_web." + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_ / "web/assets");
    Write("web/index.html", "the page");
    Write("web/assets/app-BxX2a9Zk.js", std::string(200'000, 'j'));
    Write("web/.hidden", "not for anybody");
    Write("secret.txt", "not for anybody");
    std::filesystem::create_symlink(folder_ / "secret.txt", folder_ / "web/out.txt");
  }
  ~WebRoot() { std::filesystem::remove_all(folder_); }
  std::string path() const { return (folder_ / "web").string(); }
  void Write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }

 private:
  std::filesystem::path folder_;
};

TEST(Gateway, ServesAFolderAndNothingOutsideOfIt) {
  WebRoot root;
  TestGateway gateway({.web_root = root.path()});
  EXPECT_EQ(Get(gateway.address(), "/").body, "the page");
  const RawResponse script = Get(gateway.address(), "/assets/app-BxX2a9Zk.js");
  EXPECT_EQ(script.body, std::string(200'000, 'j'));
  EXPECT_THAT(script.headers.at("cache-control"), HasSubstr("immutable"));
  for (const char* bad :
       {"/../secret.txt", "/%2e%2e/secret.txt", "/assets/../../secret.txt", "/..%2fsecret.txt", "/.hidden",
        "/out.txt", "/assets", "/assets/", "/secret.txt", "//secret.txt"}) {
    const RawResponse response = Get(gateway.address(), bad);
    EXPECT_THAT(response.status, ::testing::AnyOf(400, 404)) << bad;
    EXPECT_THAT(response.body, Not(HasSubstr("not for anybody"))) << bad;
    EXPECT_THAT(response.body, Not(HasSubstr("app-Bx"))) << "no list of a folder";
  }
}

TEST(Gateway, AWebRootWithoutAPageIsRefused) {
  const auto gateway = Gateway::Start({.listen = "127.0.0.1:0", .web_root = "/no/such"},
                                      {.security = std::make_shared<Security>()});
  ASSERT_FALSE(gateway.ok());
  EXPECT_THAT(gateway.error().message, HasSubstr("index.html"));
}

TEST(Gateway, ATakenPortIsToldWithWhatToDo) {
  TestGateway first;
  const auto second = Gateway::Start({.listen = first.address()}, {.security = std::make_shared<Security>()});
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(second.error().message, AllOf(HasSubstr(first.address()), HasSubstr("--http-listen")));
}

TEST(Gateway, OneConnectionTakesManyRequests) {
  TestGateway gateway;
  RawHttp connection(gateway.address());
  const std::string get = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
  for (int i = 0; i < 3; ++i) {
    connection.Send(get);
    EXPECT_EQ(connection.Read().body, "ok\n");
  }
  connection.Send(get + get + get);  // without waiting
  for (int i = 0; i < 3; ++i) EXPECT_EQ(connection.Read().body, "ok\n");
  connection.Send("HEAD /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(connection.Read(false).headers.at("content-length"), "3");
  connection.Send("GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(connection.Read().body, "ok\n");
  EXPECT_EQ(connection.ReadToEnd(), "");
}

TEST(Gateway, BadRequestsGetAnAnswerAndTheEnd) {
  TestGateway gateway;
  for (const auto& [text, status] :
       {std::pair<std::string, int>("nonsense\r\n\r\n", 400),
        {"GET / HTTP/1.1\r\nHost: h\r\nX: " + std::string(100'000, 'x') + "\r\n\r\n", 431},
        {"POST / HTTP/1.1\r\nHost: h\r\nContent-Length: 99999999\r\n\r\n", 413},
        {"GET / HTTP/3.1\r\n\r\n", 505}}) {
    RawHttp connection(gateway.address());
    connection.Send(text);
    const RawResponse response = connection.Read();
    EXPECT_EQ(response.status, status) << text.substr(0, 60);
    EXPECT_EQ(response.headers.at("connection"), "close");
    EXPECT_EQ(connection.ReadToEnd(), "");
  }
  EXPECT_EQ(Ask(gateway.address(), "DELETE / HTTP/1.1\r\nHost: localhost\r\n\r\n").status, 405);
  EXPECT_EQ(Ask(gateway.address(), "OPTIONS / HTTP/1.1\r\nHost: localhost\r\n\r\n").status, 405);
  EXPECT_EQ(Get(gateway.address(), "/healthz").status, 200) << "others are served";
}

TEST(Gateway, PagesOfOthersMayNotCall) {
  TestGateway gateway;
  EXPECT_EQ(Get(gateway.address(), "/healthz", "Origin: http://localhost\r\n").status, 200);
  const std::string post =
      "POST /taclink.v1.TactileService/GetArm HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n"
      "Content-Type: application/grpc-web\r\n";
  const std::string body = "\r\n" + std::string(5, '\0');
  EXPECT_EQ(Ask(gateway.address(), post + "Origin: http://localhost\r\n" + body).status, 200);
  const RawResponse foreign = Ask(gateway.address(), post + "Origin: http://evil.example\r\n" + body);
  EXPECT_EQ(foreign.status, 421);
  EXPECT_THAT(foreign.headers.at("grpc-message"), HasSubstr("http://evil.example")) << "for the page to show";
  EXPECT_FALSE(foreign.headers.contains("access-control-allow-origin"));
  EXPECT_EQ(Ask(gateway.address(), "GET /healthz HTTP/1.1\r\nHost: evil.example:8080\r\n\r\n").status, 421)
      << "a foreign name that was made to point here";
}

TEST(Gateway, SlowAndSilentConnectionsEnd) {
  TestGateway strict({.header_timeout = milliseconds(80)}), forgetful({.idle_timeout = milliseconds(80)});
  RawHttp silent(strict.address()), slow(strict.address()), body(strict.address()), idle(forgetful.address());
  slow.Send("GET /healthz HT");
  body.Send("POST /a HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nab");
  idle.Send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(idle.Read().body, "ok\n");
  for (RawHttp* each : {&silent, &slow, &idle, &body}) EXPECT_EQ(each->ReadToEnd(), "");
  EXPECT_EQ(Get(forgetful.address(), "/healthz").status, 200);
}

TEST(Gateway, WhoOnlyHoldsConnectionsKeepsNobodyOut) {
  TestGateway gateway({.max_connections = 3});
  std::vector<std::unique_ptr<RawHttp>> held;
  for (int i = 0; i < 10; ++i) held.push_back(std::make_unique<RawHttp>(gateway.address()));
  EXPECT_EQ(Get(gateway.address(), "/healthz").status, 200);
  EXPECT_EQ(held.front()->ReadToEnd(), "") << "the oldest had to go";
  EXPECT_GT(gateway.counts().refused, 0u);
}

// Begins a call that does not end.
std::unique_ptr<RawHttp> BusyConnection(const std::string& address, const char* from) {
  auto connection = std::make_unique<RawHttp>(address, from);
  connection->Send(
      "POST /taclink.v1.TactileService/StreamFrames HTTP/1.1\r\nHost: localhost\r\n"
      "Content-Type: application/grpc-web+proto\r\nContent-Length: 5\r\n\r\n" +
      std::string(5, '\0'));
  return connection;
}

TEST(Gateway, OneAddressKeepsNobodyElseOut) {
  TestGateway gateway({.max_connections = 4, .max_connections_per_peer = 2});
  std::vector<std::unique_ptr<RawHttp>> held;
  for (int i = 0; i < 4; ++i) {
    held.push_back(BusyConnection(gateway.address(), "127.0.0.2"));
    EXPECT_EQ(held.back()->ReadHead().status, i < 2 ? 200 : 429) << i;
  }
  EXPECT_EQ(gateway.counts().refused, 2u);
  EXPECT_EQ(Get(gateway.address(), "/healthz").status, 200);
}

// What watches the server has the address of the programs that take all connections.
TEST(Gateway, BusyConnectionsOfThisMachineLeaveRoomForProbes) {
  for (const GatewayOptions& options :
       {GatewayOptions{.max_connections_per_peer = 2},
        GatewayOptions{.max_connections = 2, .max_connections_per_peer = 32}}) {
    TestGateway gateway(options);
    gateway.server().Publish(0, 1);
    std::vector<std::unique_ptr<RawHttp>> held;
    for (int i = 0; i < 2; ++i) {
      held.push_back(BusyConnection(gateway.address(), "127.0.0.1"));
      EXPECT_EQ(held.back()->ReadHead().status, 200);
    }
    // Those who connect and say nothing do not keep probes out either.
    for (int i = 0; i < 20; ++i) held.push_back(std::make_unique<RawHttp>(gateway.address()));
    for (int i = 0; i < 20; ++i) {
      EXPECT_EQ(Get(gateway.address(), "/healthz").status, 200);
      EXPECT_EQ(Get(gateway.address(), "/readyz").status, 200);
    }
    const RawResponse refused = Get(gateway.address(), "/");
    EXPECT_EQ(refused.status, 429);
    EXPECT_THAT(refused.body, HasSubstr("all 2 connections"));
  }
}

TEST(Gateway, AHalfClosedConnectionIsStillAnswered) {
  TestGateway gateway;
  RawHttp connection(gateway.address());
  connection.Send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  connection.EndWriting();
  EXPECT_EQ(connection.Read().body, "ok\n");
  EXPECT_EQ(connection.ReadToEnd(), "");
}

TEST(Gateway, ReadyOnceALinkHasFrames) {
  TestGateway gateway;
  RawResponse ready = Get(gateway.address(), "/readyz");
  EXPECT_EQ(ready.status, 503);
  EXPECT_THAT(ready.body, AllOf(HasSubstr("not ready"), HasSubstr("link upper: starting")));
  gateway.server().Publish(0, 1);
  ready = Get(gateway.address(), "/readyz");
  EXPECT_EQ(ready.status, 200);
  EXPECT_EQ(ready.body, "ready\nlink lower: starting\n");
  gateway.gateway().Drain();
}

TEST(Gateway, MetricsTellOfLinksStreamsAndProcess) {
  TestGateway gateway;
  Receiver receiver(gateway.server().arm().hub());
  gateway.server().arm().Start();
  for (const uint64_t sequence : {1, 5}) {
    gateway.server().script(0).Push(sequence);
    PublicationPtr publication;
    do {
      publication = receiver.Next();
      ASSERT_NE(publication, nullptr);
    } while (publication->link() != 0 || publication->state().sequence != sequence);
  }
  const RawResponse metrics = Get(gateway.address(), "/metrics");
  EXPECT_EQ(metrics.status, 200);
  EXPECT_EQ(metrics.headers.at("content-type"), "text/plain; version=0.0.4; charset=utf-8");
  for (const char* line :
       {"# TYPE taclink_link_frames_total counter\n", "taclink_link_frames_skipped_total{link=\"upper\"} 3\n",
        "taclink_link_status{link=\"upper\",status=\"ok\"} 1\n",
        "taclink_link_status{link=\"upper\",status=\"lost\"} 0\n",
        "# TYPE taclink_link_latency_seconds histogram\n",
        "taclink_link_latency_seconds_bucket{link=\"upper\",le=\"+Inf\"} 2\n",
        "taclink_link_latency_seconds_count{link=\"upper\"} 2\n",
        "taclink_link_stage_seconds_count{link=\"upper\",stage=\"force\"} 0\n",
        "taclink_link_contacts{link=\"upper\"} 1\n", "taclink_link_source_restarts_total{link=\"lower\"} 0\n",
        "taclink_subscribers 2\n", "taclink_streams 0\n", "taclink_subscriber_dropped_frames_total 0\n",
        "taclink_link_supervision{link=\"lower\",state=\"running\"} 1\n",
        "taclink_link_worker_restarts_total{link=\"upper\"} 0\n", "taclink_http_connections 1\n"})
    EXPECT_THAT(metrics.body, HasSubstr(line));
  EXPECT_THAT(metrics.body, ::testing::ContainsRegex("process_resident_memory_bytes [1-9]"));
  EXPECT_THAT(metrics.body, ::testing::ContainsRegex("process_cpu_seconds_total [0-9.]+\n"));
}

TEST(Gateway, ATakenAddressIsAnErrorAndAnEmptyOneIsNone) {
  TestGateway gateway;
  const auto security = std::make_shared<Security>();
  HttpConfig config;
  config.listen = gateway.address();
  auto taken = StartGateway(config, gateway.server().arm(), gateway.server().server(), security);
  EXPECT_FALSE(taken.ok());
  config.listen = "";
  auto off = StartGateway(config, gateway.server().arm(), gateway.server().server(), security);
  ASSERT_TRUE(off.ok());
  EXPECT_EQ(*off, nullptr);
}

}  // namespace
}  // namespace taclink::server

// gRPC calls with and without tokens and certificates.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/unknown_field_set.h>
#include <grpcpp/create_channel.h>
#include <openssl/ssl.h>

#include <algorithm>
#include <csignal>
#include <future>
#include <utility>
#include <vector>

#include "server/gateway/grpc_call.h"
#include "server/gateway/grpc_web.h"
#include "taclink/v1/events.pb.h"
#include "taclink/v1/tactile.grpc.pb.h"
#include "tests/integration/support.h"
#include "tests/server/gateway/security_support.h"
#include "tests/server/gateway/support.h"
#include "tests/support/http2_frames.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

constexpr milliseconds kSoon{400};  // for connections that are to fail

/// What one call of a method brought.
struct Outcome {
  std::string message;
  WebStatus status;
};
Outcome Call(const std::shared_ptr<grpc::Channel>& channel, const GrpcCallRequest& request) {
  GrpcCalls calls(channel);
  const auto call = calls.Start(request, [] {});
  Outcome out;
  while (true) {
    const auto event = call->Take();
    if (!event) {
      std::this_thread::yield();
      continue;
    }
    if (const auto* status = std::get_if<WebStatus>(&*event)) return out.status = *status, out;
    out.message = std::get<std::string>(*event);
  }
}

Outcome Call(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
             const std::string& message) {
  return Call(channel,
              {.method = method, .messages = {message}, .timeout = kForever, .peer = "test", .name = {}});
}

constexpr const char* kSetThresholds = "/taclink.v1.TactileService/SetThresholds";

std::string ThresholdsMessage() {
  v1::SetThresholdsRequest request;
  request.set_link("lower");
  request.mutable_thresholds()->set_warning_n(1);
  request.mutable_thresholds()->set_alarm_n(2);
  return request.SerializeAsString();
}

// Whose order the next event of a change of thresholds names.
std::string WhoSetThresholds(TestServer& server, const std::function<void()>& order) {
  server.arm().events().Start();
  auto client = server.Connect();
  const auto events = client.StreamEvents(EventsOf({v1::EVENT_KIND_THRESHOLDS}), kForever);
  EXPECT_TRUE(events.ok());
  order();
  const auto event = (*events)->Next(kForever);
  server.arm().events().Stop();
  EXPECT_TRUE(event.ok() && event->operation().accepted());
  return event ? event->operation().who() : "";
}

class GrpcSecurity : public SecurityTest {
 protected:
  void Serve(const SecurityConfig& config) {
    security_ = Load(config);
    auto server =
        RpcServer::Start("127.0.0.1:0", arm_.arm(), {.max_streams = 4, .queue_messages = 32}, security_);
    ASSERT_TRUE(server.ok()) << server.error().message;
    server_ = std::move(*server);
  }
  Result<client::Client> Connect(const client::Credentials& credentials,
                                 milliseconds patience = kForever) const {
    return client::Client::Connect(server_->address(), patience, credentials);
  }
  // Connects and asks for the arm. None: it went well.
  std::optional<ErrorCode> GetArm(const client::Credentials& credentials) const {
    auto client = Connect(credentials);
    if (!client) return client.error().code;
    const auto arm = client->GetArm(kForever);
    return arm ? kGood : std::optional(arm.error().code);
  }
  static constexpr std::optional<ErrorCode> kGood = std::nullopt;

  TestServer arm_;
  std::shared_ptr<Security> security_;
  std::unique_ptr<RpcServer> server_;
};

// The names in an answer of gRPC's reflection to "list services", for which Debian has no generated code.
std::vector<std::string> ServiceNames(const std::string& answer) {
  google::protobuf::UnknownFieldSet fields, list, service;
  EXPECT_TRUE(fields.ParseFromString(answer));
  std::vector<std::string> names;
  for (int i = 0; i < fields.field_count(); ++i) {
    if (fields.field(i).number() != 6) continue;  // list_services_response
    EXPECT_TRUE(list.ParseFromString(fields.field(i).length_delimited()));
    for (int j = 0; j < list.field_count(); ++j) {
      EXPECT_TRUE(service.ParseFromString(list.field(j).length_delimited()));
      names.push_back(service.field(0).length_delimited());
    }
  }
  return names;
}

bool InTable(const std::string& path) {
  const auto table = AccessTable();
  return std::any_of(table.begin(), table.end(), [&](const AccessRule& rule) { return rule.path == path; });
}

/// Sends `begin` and then `flood` over and over, encrypted. Whether the server ended that before it got
/// `most` bytes.
bool FloodTls(const std::string& address, const std::string& begin, const std::string& flood, size_t most) {
  SSL_CTX* const context = SSL_CTX_new(TLS_client_method());
  const unsigned char protocols[] = "\x02h2";
  SSL_CTX_set_alpn_protos(context, protocols, sizeof protocols - 1);
  BIO* const bio = BIO_new_ssl_connect(context);
  BIO_set_conn_hostname(bio, address.c_str());
  const bool shaken = BIO_do_connect(bio) == 1 && BIO_do_handshake(bio) == 1;
  EXPECT_TRUE(shaken);
  bool ended = false;
  if (shaken) BIO_write(bio, begin.data(), static_cast<int>(begin.size()));
  for (size_t sent = 0; shaken && !ended && sent < most; sent += flood.size())
    ended = BIO_write(bio, flood.data(), static_cast<int>(flood.size())) <= 0;
  BIO_free_all(bio);
  SSL_CTX_free(context);
  return ended;
}

TEST_F(GrpcSecurity, AFloodOfFramesEndsItsEncryptedConnection) {
  using namespace taclink::testing;
  std::signal(SIGPIPE, SIG_IGN);  // BIO_write raises it
  SecurityConfig config = Tls();
  config.tokens = Path("tokens");
  Serve(config);
  std::string continuations, resets;
  for (int i = 0; i < 100; ++i) {
    continuations += Frame(Http2Frame::kContinuation, 0, 1, Field("a", std::string(100, 'b')));
    resets += Frame(Http2Frame::kHeaders, kEndHeaders, 1, CallFields("/x")) +
              Frame(Http2Frame::kReset, 0, 1, std::string(4, '\0'));
  }
  constexpr size_t kMost = size_t{32} << 20;
  EXPECT_TRUE(FloodTls(server_->address(), Preface() + Frame(Http2Frame::kHeaders, 0, 1, CallFields("/x")),
                       continuations, kMost));
  EXPECT_TRUE(FloodTls(server_->address(), Preface(), resets, kMost));
  EXPECT_GE(server_->connections().violations, 1u);
  EXPECT_EQ(GetArm({.ca_file = Path("ca.pem"), .token = kOperator}), kGood) << "others go on";
}

TEST_F(GrpcSecurity, EveryMethodOfEveryServiceIsInTheTable) {
  const Outcome listed =
      Call(arm_.server().InProcessChannel(), "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
           {"\x3a\x00", 2});
  const auto names = ServiceNames(listed.message);
  EXPECT_THAT(names, ::testing::Contains("taclink.v1.TactileService"));
  for (const std::string& name : names) {
    const auto* service = google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(name);
    if (service == nullptr) continue;  // gRPC's own
    for (int i = 0; i < service->method_count(); ++i) {
      const std::string path = "/" + name + "/" + service->method(i)->name();
      EXPECT_TRUE(InTable(path)) << path << ": say in server/security/access.cpp who may call it";
    }
  }
}

TEST_F(GrpcSecurity, TheTableNamesNothingTwice) {
  for (const AccessRule& rule : AccessTable()) {
    const auto table = AccessTable();
    EXPECT_EQ(
        std::count_if(table.begin(), table.end(), [&](const auto& other) { return other.path == rule.path; }),
        1)
        << rule.path;
  }
}

TEST_F(GrpcSecurity, TokensDecideOnLoopback) {
  Serve(WithTokens());
  EXPECT_EQ(GetArm({}), ErrorCode::kUnauthenticated);
  EXPECT_EQ(GetArm({.token = "wrong"}), ErrorCode::kUnauthenticated);
  EXPECT_EQ(GetArm({.token = kViewer}), kGood);
  EXPECT_EQ(GetArm({.token = kOperator}), kGood);
}

TEST_F(GrpcSecurity, AViewerSeesButDoesNotChange) {
  Serve(WithTokens());
  auto viewer = Connect({.token = kViewer}), admin = Connect({.token = kOperator});
  ASSERT_TRUE(viewer.ok() && admin.ok());
  EXPECT_TRUE(viewer->StreamFrames({}, kForever).ok());
  v1::CalibrateRequest request;
  request.set_link("no such");
  const auto refused = viewer->Calibrate(request, {}, kForever);
  EXPECT_EQ(refused.error().code, ErrorCode::kPermissionDenied);
  EXPECT_THAT(refused.error().message, HasSubstr("'eve' is a viewer"));
  EXPECT_EQ(admin->Calibrate(request, {}, kForever).error().code, ErrorCode::kNotFound);
}

TEST_F(GrpcSecurity, TheAuditNamesTheTokenAndTheAddress) {
  Serve(WithTokens());
  const std::string who = WhoSetThresholds(arm_, [this] {
    auto otto = Connect({.token = kOperator});
    EXPECT_TRUE(otto.ok() && otto->SetThresholds("lower", "", MakeThresholds(1, 2), kForever).ok());
  });
  EXPECT_THAT(who, ::testing::StartsWith("otto ipv4:127.0.0.1:"));
}

TEST_F(GrpcSecurity, TheAuditNamesWhoCallsThroughTheGateway) {
  TestGateway gateway({}, Load(WithTokens()));
  const std::string body = EncodeMessage(WebFormat::kBinary, ThresholdsMessage());
  const std::string who = WhoSetThresholds(gateway.server(), [&] {
    Ask(gateway.address(),
        std::string("POST ") + kSetThresholds +
            " HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/grpc-web+proto\r\n" +
            "Authorization: Bearer " + kOperator + "\r\nContent-Length: " + std::to_string(body.size()) +
            "\r\n\r\n" + body);
  });
  EXPECT_THAT(who, ::testing::StartsWith("otto ipv4:127.0.0.1:"));
}

TEST_F(GrpcSecurity, NobodyCallsInAnothersName) {
  const std::string who = WhoSetThresholds(arm_, [this] {
    const auto channel = grpc::CreateChannel(arm_.server().address(), grpc::InsecureChannelCredentials());
    Call(channel, {.method = kSetThresholds,
                   .messages = {ThresholdsMessage()},
                   .timeout = kForever,
                   .peer = "ipv4:192.0.2.1:1",
                   .name = "otto"});
  });
  EXPECT_THAT(who, ::testing::StartsWith("ipv4:127.0.0.1:"));
}

TEST_F(GrpcSecurity, TwoTokensInOneCallAreRefused) {
  Serve(WithTokens());
  const auto channel = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
  const auto stub = v1::TactileService::NewStub(channel);
  const auto set_thresholds = [&](const std::vector<std::string>& tokens) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kForever);
    for (const std::string& token : tokens) context.AddMetadata("authorization", "Bearer " + token);
    v1::SetThresholdsRequest request;
    EXPECT_TRUE(request.ParseFromString(ThresholdsMessage()));
    v1::SetThresholdsResponse response;
    return stub->SetThresholds(&context, request, &response);
  };
  EXPECT_TRUE(set_thresholds({kOperator}).ok());
  for (const auto& [first, second] : {std::pair(kViewer, kOperator), std::pair(kOperator, kViewer)}) {
    const grpc::Status refused = set_thresholds({first, second});
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::UNAUTHENTICATED);
    EXPECT_THAT(refused.error_message(), HasSubstr("2 'authorization' headers"));
  }
}

TEST_F(GrpcSecurity, ACertificateHasOneNameForGrpcAndForHttp) {
  Serve(MutualTls());
  WritePair("client", authority_.Issue("client"));  // which also has alternative names
  const std::string who = WhoSetThresholds(arm_, [this] {
    auto client = Connect({.ca_file = Path("ca.pem"),
                           .certificate_file = Path("client.pem"),
                           .key_file = Path("client.key"),
                           .token = {}});
    EXPECT_TRUE(client.ok() && client->SetThresholds("lower", "", MakeThresholds(1, 2), kForever).ok());
  });
  EXPECT_THAT(who, ::testing::StartsWith("client ipv4:127.0.0.1:"));
}

TEST_F(GrpcSecurity, HealthNeedsNoTokenAndReflectionDoes) {
  Serve(WithTokens());
  const auto channel = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
  EXPECT_EQ(Call(channel, "/grpc.health.v1.Health/Check", "").status.code, 0);
  EXPECT_EQ(Call(channel, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", {"\x3a\x00", 2})
                .status.code,
            16);
  EXPECT_EQ(Call(channel, "/taclink.v1.TactileService/NoSuchMethod", "").status.code, 16)
      << "who may not call learns nothing";
}

TEST_F(GrpcSecurity, ATokenWithdrawnEndsItsRights) {
  Serve(WithTokens());
  auto client = Connect({.token = kViewer});
  ASSERT_TRUE(client.ok() && client->GetArm(kForever).ok());
  Write("tokens", TokenLine("otto", "operator", kOperator));
  security_->Reload();
  EXPECT_EQ(client->GetArm(kForever).error().code, ErrorCode::kUnauthenticated) << "on the same connection";
}

TEST_F(GrpcSecurity, WrongTokensAreThrottledWhileARightOneCalls) {
  SecurityConfig config = WithTokens();
  config.max_failed_tries = 3;
  Serve(config);
  auto wrong = Connect({.token = "guess"}), right = Connect({.token = kViewer});
  ASSERT_TRUE(wrong.ok() && right.ok());
  for (int i = 0; i < 200; ++i) {
    EXPECT_EQ(wrong->GetArm(kForever).error().code,
              i < 3 ? ErrorCode::kUnauthenticated : ErrorCode::kResourceExhausted);
    EXPECT_TRUE(right->GetArm(kForever).ok());
  }
  EXPECT_EQ(security_->Status().tries_unknown, 200u);
}

TEST_F(GrpcSecurity, AnEmptiedTokenFileIsNoFaultOfTheCallers) {
  Serve(WithTokens());
  auto client = Connect({.token = kViewer});
  ASSERT_TRUE(client.ok() && client->GetArm(kForever).ok());
  Write("tokens", "");
  security_->Reload();
  EXPECT_EQ(client->GetArm(kForever).error().code, ErrorCode::kFailedPrecondition)
      << "on the same connection";
}

TEST_F(GrpcSecurity, TlsServesThoseWhoTrustIt) {
  Serve(WithTokens(Tls()));
  EXPECT_EQ(GetArm({.ca_file = Path("ca.pem"), .token = kViewer}), kGood);
  EXPECT_EQ(GetArm({.ca_file = Path("ca.pem")}), ErrorCode::kUnauthenticated);
  EXPECT_FALSE(Connect({.token = kViewer}, kSoon).ok()) << "in the clear";
  Write("other.pem", TestAuthority().pem());
  EXPECT_FALSE(Connect({.ca_file = Path("other.pem")}, kSoon).ok()) << "a server of somebody else's";
}

TEST_F(GrpcSecurity, MutualTlsServesThoseWithACertificate) {
  Serve(MutualTls());
  WritePair("client", authority_.Issue("client"));
  WritePair("stranger", TestAuthority().Issue("client"));
  WritePair("late", authority_.Issue("client", -1));
  const auto with = [this](const std::string& name) {
    return client::Credentials{.ca_file = Path("ca.pem"),
                               .certificate_file = Path(name + ".pem"),
                               .key_file = Path(name + ".key"),
                               .token = {}};
  };
  EXPECT_EQ(GetArm(with("client")), kGood);
  const auto refused = [this](const client::Credentials& credentials) {
    auto client = Connect(credentials, kSoon);  // TLS 1.3 tells a client late that it is refused
    return !client.ok() || !client->GetArm(kSoon).ok();
  };
  EXPECT_TRUE(refused({.ca_file = Path("ca.pem")})) << "no certificate";
  EXPECT_TRUE(refused(with("stranger")));
  EXPECT_TRUE(refused(with("late")));
}

TEST_F(GrpcSecurity, CertificatesChangeWithoutARestart) {
  Serve(Tls());
  const client::Credentials old_trust{.ca_file = Path("ca.pem")};
  auto before = Connect(old_trust);
  ASSERT_TRUE(before.ok());
  const TestAuthority next;
  Write("next.pem", next.pem());
  WriteServer(next);
  security_->Reload();
  EXPECT_EQ(GetArm({.ca_file = Path("next.pem")}), kGood);
  EXPECT_FALSE(Connect(old_trust, kSoon).ok());
  EXPECT_TRUE(before->GetArm(kForever).ok()) << "open connections go on";
  Write("server.key", authority_.Issue("other").key);
  security_->Reload();
  Write("again.pem", next.pem());
  EXPECT_EQ(GetArm({.ca_file = Path("again.pem")}), kGood)
      << "a key that is not the certificate's changes nothing";
}

TEST_F(GrpcSecurity, AClientKeepsItsTokenToItself) {
  const auto complaint = [this](const std::string& address, const client::Credentials& credentials) {
    const auto client = client::Client::Connect(address, milliseconds(1), credentials);
    return client ? "connected" : client.error().message;
  };
  EXPECT_THAT(complaint("192.0.2.1:50051", {.token = "secret"}), HasSubstr("in the clear"));
  EXPECT_THAT(complaint("127.0.0.1.evil:50051", {.token = "secret"}), HasSubstr("in the clear"));
  EXPECT_THAT(complaint("127.0.0.1:1", {.token = "secret"}), HasSubstr("no server answers"));
  EXPECT_THAT(complaint("127.0.0.1:1", {.ca_file = "no-such.pem"}), HasSubstr("no-such.pem cannot be read"));
  EXPECT_THAT(complaint("127.0.0.1:1", {.certificate_file = "a.pem"}), HasSubstr("need each other"));
  EXPECT_THAT(complaint("127.0.0.1:1", {.certificate_file = "a.pem", .key_file = "a.key"}),
              HasSubstr("needs TLS"));
}

}  // namespace
}  // namespace taclink::server

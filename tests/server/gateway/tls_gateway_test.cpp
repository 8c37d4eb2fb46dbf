// HTTPS, and the gateway under the same table as gRPC.
#include <gmock/gmock.h>
#include <openssl/ssl.h>
#include <sys/socket.h>

#include "server/gateway/grpc_web.h"
#include "server/security/tls_policy.h"
#include "tests/server/gateway/security_support.h"
#include "tests/server/gateway/support.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

constexpr const char* kGet = "GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";

/// What a client gets that trusts `ca`; `pair` of files, or none. Empty: nothing.
std::string AskTls(const std::string& address, const std::string& ca, const std::string& pair,
                   const std::string& text) {
  SSL_CTX* const context = SSL_CTX_new(TLS_client_method());
  SSL_CTX_load_verify_locations(context, ca.c_str(), nullptr);
  SSL_CTX_set_verify(context, SSL_VERIFY_PEER, nullptr);
  if (!pair.empty()) {
    SSL_CTX_use_certificate_chain_file(context, (pair + ".pem").c_str());
    SSL_CTX_use_PrivateKey_file(context, (pair + ".key").c_str(), SSL_FILETYPE_PEM);
  }
  BIO* const bio = BIO_new_ssl_connect(context);
  BIO_set_conn_hostname(bio, address.c_str());
  std::string out;
  if (BIO_do_connect(bio) == 1 && BIO_do_handshake(bio) == 1) {
    BIO_write(bio, text.data(), static_cast<int>(text.size()));
    char block[4096];
    for (int size = 0; (size = BIO_read(bio, block, sizeof block)) > 0;)
      out.append(block, static_cast<size_t>(size));
  }
  BIO_free_all(bio);
  SSL_CTX_free(context);
  return out;
}

/// Whether a client that speaks only this version of TLS, and of TLS 1.2 only this cipher, is served.
bool Shakes(const std::string& address, int version, const std::string& cipher) {
  SSL_CTX* const context = SSL_CTX_new(TLS_client_method());
  EXPECT_EQ(SSL_CTX_set_min_proto_version(context, version), 1);
  EXPECT_EQ(SSL_CTX_set_max_proto_version(context, version), 1);
  EXPECT_EQ(SSL_CTX_set_cipher_list(context, (cipher + ":@SECLEVEL=0").c_str()), 1) << cipher;
  BIO* const bio = BIO_new_ssl_connect(context);
  BIO_set_conn_hostname(bio, address.c_str());
  const bool shaken = BIO_do_connect(bio) == 1 && BIO_do_handshake(bio) == 1;
  BIO_free_all(bio);
  SSL_CTX_free(context);
  return shaken;
}

class TlsGateway : public SecurityTest {};

TEST_F(TlsGateway, OnlyAuthenticatedEncryptionWithEphemeralKeys) {
  constexpr const char* kAny = "ALL";
  const TestGateway gateway({}, Load(Tls()));
  const auto shakes = [&](int version, const char* cipher) {
    return Shakes(gateway.address(), version, cipher);
  };
  EXPECT_TRUE(shakes(TLS1_3_VERSION, kAny));
  for (const char* good : {"ECDHE-ECDSA-AES128-GCM-SHA256", "ECDHE-ECDSA-CHACHA20-POLY1305"})
    EXPECT_TRUE(shakes(TLS1_2_VERSION, good)) << good;
  for (const char* bad : {"ECDHE-ECDSA-AES128-SHA", "ECDHE-ECDSA-AES256-SHA384", "ECDHE-ECDSA-AES128-CCM"})
    EXPECT_FALSE(shakes(TLS1_2_VERSION, bad)) << bad;
  EXPECT_FALSE(shakes(TLS1_1_VERSION, kAny));
}

TEST(TlsPolicy, ItsCiphersAreKnownAndModern) {
  SSL_CTX* const context = SSL_CTX_new(TLS_server_method());
  ASSERT_EQ(SSL_CTX_set_cipher_list(context, kTlsCiphers), 1);
  const STACK_OF(SSL_CIPHER)* const ciphers = SSL_CTX_get_ciphers(context);
  EXPECT_GE(sk_SSL_CIPHER_num(ciphers), 6);
  for (int i = 0; i < sk_SSL_CIPHER_num(ciphers); ++i) {
    const SSL_CIPHER* const cipher = sk_SSL_CIPHER_value(ciphers, i);
    EXPECT_EQ(SSL_CIPHER_is_aead(cipher), 1) << SSL_CIPHER_get_name(cipher);
    EXPECT_THAT(SSL_CIPHER_get_kx_nid(cipher), ::testing::AnyOf(NID_kx_ecdhe, NID_kx_any))
        << SSL_CIPHER_get_name(cipher);
  }
  SSL_CTX_free(context);
}

TEST_F(TlsGateway, ServesThoseWhoTrustIt) {
  TestGateway gateway({}, Load(Tls()));
  EXPECT_THAT(AskTls(gateway.address(), Path("ca.pem"), "", kGet), HasSubstr("200 OK"));
  Write("other.pem", TestAuthority().pem());
  EXPECT_EQ(AskTls(gateway.address(), Path("other.pem"), "", kGet), "");
  RawHttp plain(gateway.address());
  plain.Send(kGet);
  EXPECT_THAT(plain.ReadToEnd(), ::testing::Not(HasSubstr("HTTP/1.1"))) << "in the clear";
  EXPECT_THAT(AskTls(gateway.address(), Path("ca.pem"), "", kGet), HasSubstr("200 OK")) << "still";
}

TEST_F(TlsGateway, AsksForAClientsCertificate) {
  TestGateway gateway({}, Load(MutualTls()));
  WritePair("client", authority_.Issue("client"));
  WritePair("stranger", TestAuthority().Issue("client"));
  EXPECT_THAT(AskTls(gateway.address(), Path("ca.pem"), Path("client"), kGet), HasSubstr("200 OK"));
  EXPECT_EQ(AskTls(gateway.address(), Path("ca.pem"), "", kGet), "");
  EXPECT_EQ(AskTls(gateway.address(), Path("ca.pem"), Path("stranger"), kGet), "");
}

TEST_F(TlsGateway, CertificatesChangeWithoutARestart) {
  const auto security = Load(Tls());
  TestGateway gateway({}, security);
  EXPECT_THAT(AskTls(gateway.address(), Path("ca.pem"), "", kGet), HasSubstr("200 OK"));
  const TestAuthority next;
  Write("next.pem", next.pem());
  WriteServer(next);
  security->Reload();
  EXPECT_THAT(AskTls(gateway.address(), Path("next.pem"), "", kGet), HasSubstr("200 OK"));
  EXPECT_EQ(AskTls(gateway.address(), Path("ca.pem"), "", kGet), "");
}

TEST_F(TlsGateway, AHandshakeThatStallsEnds) {
  TestGateway gateway({.header_timeout = std::chrono::milliseconds(80)}, Load(Tls()));
  RawHttp silent(gateway.address());
  EXPECT_EQ(silent.ReadToEnd(), "");
}

TEST_F(TlsGateway, TokensDecideOverHttpToo) {
  TestGateway gateway({}, Load(WithTokens()));
  const auto bearer = [](const std::string& token) { return "Authorization: Bearer " + token + "\r\n"; };
  EXPECT_EQ(Get(gateway.address(), "/").status, 200) << "the page itself holds nothing";
  EXPECT_EQ(Get(gateway.address(), "/healthz").status, 200);
  const RawResponse refused = Get(gateway.address(), "/metrics");
  EXPECT_EQ(refused.status, 401);
  EXPECT_EQ(refused.headers.at("www-authenticate"), "Bearer");
  EXPECT_EQ(Get(gateway.address(), "/metrics", bearer("wrong")).status, 401);
  EXPECT_EQ(Get(gateway.address(), "/metrics", bearer(kViewer)).status, 200);
}

TEST_F(TlsGateway, TokensDecideOverGrpcWebToo) {
  TestGateway gateway({}, Load(WithTokens()));
  const auto call = [&](const std::string& method, const std::string& more) {
    const std::string body = EncodeMessage(WebFormat::kBinary, "");
    return Ask(gateway.address(),
               "POST /taclink.v1.TactileService/" + method +
                   " HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/grpc-web\r\n" + more +
                   "Content-Length: 5\r\n\r\n" + body)
        .body;
  };
  const std::string viewer = "Authorization: Bearer " + std::string(kViewer) + "\r\n";
  const std::string admin = "Authorization: Bearer " + std::string(kOperator) + "\r\n";
  EXPECT_THAT(call("GetArm", ""), HasSubstr("grpc-status: 16\r\n"));
  EXPECT_THAT(call("GetArm", "Authorization: Bearer wrong\r\n"), HasSubstr("grpc-status: 16\r\n"));
  EXPECT_THAT(call("GetArm", viewer), HasSubstr("grpc-status: 0\r\n"));
  EXPECT_THAT(call("Calibrate", viewer), HasSubstr("grpc-status: 7\r\ngrpc-message: 'eve' is a viewer"));
  EXPECT_THAT(call("Calibrate", admin), HasSubstr("grpc-status: 5\r\n")) << "no link of that name";
}

RawResponse GetWith(const TestGateway& gateway, const std::string& page, const std::string& token) {
  return Get(gateway.address(), page, "Authorization: Bearer " + token + "\r\n");
}

TEST_F(TlsGateway, WrongTokensAreThrottledWhileARightOneCalls) {
  SecurityConfig config = WithTokens();
  config.max_failed_tries = 3;
  const TestGateway gateway({}, Load(config));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(GetWith(gateway, "/metrics", "guess").status, i < 3 ? 401 : 429);
    EXPECT_EQ(GetWith(gateway, "/metrics", kViewer).status, 200);
  }
  EXPECT_EQ(GetWith(gateway, "/healthz", "guess").status, 200) << "asks for no token";
  const std::string metrics = GetWith(gateway, "/metrics", kViewer).body;
  EXPECT_THAT(metrics, HasSubstr("taclink_failed_tries_total{token=\"unknown\"} 21\n"));
  EXPECT_THAT(metrics, HasSubstr("taclink_throttled_tries_total 18\n"));
}

TEST_F(TlsGateway, ReadinessTellsOfATokenFileInErrorWithoutItsName) {
  const auto security = Load(WithTokens());
  TestGateway gateway({}, security);
  gateway.server().Publish(0, 1);
  EXPECT_EQ(GetWith(gateway, "/readyz", "").status, 200);
  Write("tokens", "");
  security->Reload();
  const RawResponse answer = GetWith(gateway, "/readyz", "");
  EXPECT_EQ(answer.status, 503);
  EXPECT_THAT(answer.body, HasSubstr("security: nobody is let in"));
  EXPECT_THAT(answer.body, ::testing::Not(HasSubstr(Path("tokens"))));
  EXPECT_EQ(GetWith(gateway, "/metrics", kViewer).status, 503);
}

}  // namespace
}  // namespace taclink::server

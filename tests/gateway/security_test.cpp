// Files that guard a server: read, checked, read anew.
#include "server/security/security.h"

#include <gmock/gmock.h>
#include <spdlog/spdlog.h>

#include "tests/gateway/security_support.h"
#include "tests/support/log_capture.h"

namespace taclink::server {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kGetArm = "/taclink.v1.TactileService/GetArm";
constexpr const char* kCalibrate = "/taclink.v1.TactileService/Calibrate";

std::string Bearer(const std::string& token) {
  return "Bearer " + token;
}

ErrorCode CodeOf(const Result<Caller>& caller) {
  return caller ? ErrorCode::kInternal : caller.error().code;
}

std::string Complaint(const SecurityConfig& config) {
  const auto security = Security::Load(config);
  return security ? "accepted" : security.error().message;
}

TEST_F(SecurityTest, WithoutTokensEverybodyIsAnOperator) {
  const Security open;
  EXPECT_TRUE(open.Check(kCalibrate, "").ok());
  EXPECT_EQ(open.tls(), nullptr);
  EXPECT_TRUE(Load(Tls())->Check(kCalibrate, "").ok());
}

TEST_F(SecurityTest, RolesByTheTable) {
  const auto security = Load(WithTokens());
  const auto viewer = security->Check(kGetArm, Bearer(kViewer));
  ASSERT_TRUE(viewer.ok());
  EXPECT_EQ(viewer->name, "eve");
  EXPECT_EQ(CodeOf(security->Check(kCalibrate, Bearer(kViewer))), ErrorCode::kPermissionDenied);
  EXPECT_EQ(CodeOf(security->Check("/not.in.the/Table", Bearer(kViewer))), ErrorCode::kPermissionDenied);
  for (const char* path : {kGetArm, kCalibrate, "/not.in.the/Table", "/metrics"})
    EXPECT_TRUE(security->Check(path, Bearer(kOperator)).ok()) << path;
  for (const char* path : {"/healthz", "/readyz", "/grpc.health.v1.Health/Check"})
    EXPECT_TRUE(security->Check(path, "").ok()) << path;
}

TEST_F(SecurityTest, WhatIsNoKnownTokenIsRefused) {
  const auto security = Load(WithTokens());
  for (const std::string& bad :
       {std::string(), std::string("Bearer"), std::string("Bearer "), std::string(kViewer), Bearer("wrong"),
        Bearer(kViewer) + " ", Bearer(std::string(kViewer) + "x"), "Basic " + std::string(kViewer),
        "Bearer" + std::string(kViewer)})
    EXPECT_EQ(CodeOf(security->Check(kGetArm, bad)), ErrorCode::kUnauthenticated) << bad;
  EXPECT_TRUE(security->Check(kGetArm, "bearer  " + std::string(kViewer)).ok());
}

TEST_F(SecurityTest, TheTokenFileItselfIsNoToken) {
  const auto security = Load(WithTokens());
  const std::string line = TokenLine("eve", "viewer", kViewer);
  const std::string hash = line.substr(line.rfind(' ') + 1, 64);
  EXPECT_EQ(CodeOf(security->Check(kGetArm, Bearer(hash))), ErrorCode::kUnauthenticated);
}

TEST_F(SecurityTest, BadTokenFilesAreNamedWithTheLine) {
  const auto complaint = [this](const std::string& text) {
    Write("tokens", text);
    return Complaint(WithTokens());
  };
  EXPECT_THAT(complaint("# nothing\n\n"), HasSubstr("holds no token"));
  EXPECT_THAT(complaint("# a\neve viewer\n"), AllOf(HasSubstr("tokens:2: "), HasSubstr("taclink token")));
  EXPECT_THAT(complaint("eve viewer abc\n"), HasSubstr("64 hexadecimal digits"));
  EXPECT_THAT(complaint("eve viewer " + std::string(64, 'g')), HasSubstr("64 hexadecimal digits"));
  EXPECT_THAT(complaint("eve viewer " + std::string(66, 'a')), HasSubstr("64 hexadecimal digits"));
  EXPECT_THAT(complaint("eve root " + std::string(64, 'a')), HasSubstr("viewer or operator, not 'root'"));
  EXPECT_THAT(complaint("eve viewer " + std::string(64, 'a') + " more"), HasSubstr("NAME ROLE"));
  EXPECT_EQ(complaint("  eve\tviewer " + std::string(64, 'A') + "  # of a robot\r\n"), "accepted");
  SecurityConfig missing;
  missing.tokens = Path("no-such");
  EXPECT_THAT(Complaint(missing), AllOf(HasSubstr("no-such"), HasSubstr("cannot be read")));
}

TEST_F(SecurityTest, BadCertificatesAreNamed) {
  EXPECT_EQ(Complaint(MutualTls()), "accepted");
  Write("server.key", authority_.Issue("other").key);
  EXPECT_THAT(Complaint(Tls()),
              AllOf(HasSubstr("server.key"), HasSubstr("is not the key of"), HasSubstr("server.pem")));
  Write("server.key", "nonsense");
  EXPECT_THAT(Complaint(Tls()), AllOf(HasSubstr("server.key"), HasSubstr("no private key in PEM form")));
  Write("server.pem", "nonsense");
  EXPECT_THAT(Complaint(Tls()), AllOf(HasSubstr("server.pem"), HasSubstr("no certificate in PEM form")));
  WriteServer(authority_);
  Write("ca.pem", "");
  EXPECT_THAT(Complaint(MutualTls()), AllOf(HasSubstr("ca.pem"), HasSubstr("no certificate")));
  std::filesystem::remove(Path("ca.pem"));
  EXPECT_THAT(Complaint(MutualTls()), HasSubstr("cannot be read"));
}

TEST_F(SecurityTest, OpenKeysAndExpiredCertificatesAreWarnedOf) {
  const auto warnings = [this] {
    const auto material = ReadTlsFiles(Tls());
    EXPECT_TRUE(material.ok());
    return TlsWarnings(Tls(), *material);
  };
  EXPECT_EQ(warnings(), "");
  WritePair("server", authority_.Issue("server", -1));
  std::filesystem::permissions(Path("server.key"), std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  EXPECT_THAT(warnings(), AllOf(HasSubstr("chmod 600"), HasSubstr("has expired")));
}

TEST_F(SecurityTest, ChangedFilesAreTakenAndBadOnesAreNot) {
  const auto security = Load(WithTokens(Tls()));
  const auto first = security->tls();
  security->Reload();
  EXPECT_EQ(security->tls(), first) << "nothing has changed";
  WriteServer(authority_);
  Write("tokens", TokenLine("new", "viewer", "fresh"));
  security->Reload();
  const auto second = security->tls();
  EXPECT_NE(second, first);
  EXPECT_EQ(CodeOf(security->Check(kGetArm, Bearer(kViewer))), ErrorCode::kUnauthenticated);
  EXPECT_EQ(security->Check(kGetArm, Bearer("fresh"))->name, "new");
  Write("server.key", authority_.Issue("other").key);  // half of an exchange
  security->Reload();
  EXPECT_EQ(security->tls(), second);
  Write("tokens", "nonsense");
  security->Reload();
  EXPECT_TRUE(security->Check(kGetArm, Bearer("fresh")).ok());
}

TEST_F(SecurityTest, ABadFileIsComplainedAboutOnce) {
  const LogCapture log;
  const auto security = Load(WithTokens());
  Write("tokens", "nonsense");
  security->Reload();
  const std::string once = log.text();
  EXPECT_THAT(once, AllOf(HasSubstr("tokens:1: "), HasSubstr("stays in use")));
  security->Reload();
  EXPECT_EQ(log.text(), once);
}

}  // namespace
}  // namespace taclink::server

// Files that guard a server: read, checked, reloaded.
#include "server/security/security.h"

#include <gmock/gmock.h>
#include <spdlog/spdlog.h>

#include <functional>
#include <utility>
#include <vector>

#include "sensing/core/utc_time.h"
#include "tests/server/gateway/security_support.h"
#include "tests/server/support.h"
#include "tests/support/log_capture.h"
#include "tests/support/prerequisite.h"

namespace taclink::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kGetArm = "/taclink.v1.TactileService/GetArm";
constexpr const char* kHere = "ipv4:192.0.2.1";
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
  EXPECT_TRUE(open.Check(kCalibrate, "", kHere).ok());
  EXPECT_EQ(open.tls(), nullptr);
  EXPECT_TRUE(Load(Tls())->Check(kCalibrate, "", kHere).ok());
}

TEST_F(SecurityTest, RolesByTheTable) {
  const auto security = Load(WithTokens());
  const auto viewer = security->Check(kGetArm, Bearer(kViewer), kHere);
  ASSERT_TRUE(viewer.ok());
  EXPECT_EQ(viewer->name, "eve");
  EXPECT_EQ(CodeOf(security->Check(kCalibrate, Bearer(kViewer), kHere)), ErrorCode::kPermissionDenied);
  EXPECT_EQ(CodeOf(security->Check("/not.in.the/Table", Bearer(kViewer), kHere)),
            ErrorCode::kPermissionDenied);
  for (const char* path : {kGetArm, kCalibrate, "/not.in.the/Table", "/metrics"})
    EXPECT_TRUE(security->Check(path, Bearer(kOperator), kHere).ok()) << path;
  for (const char* path : {"/healthz", "/readyz", "/grpc.health.v1.Health/Check"})
    EXPECT_TRUE(security->Check(path, "", kHere).ok()) << path;
}

TEST_F(SecurityTest, WhatIsNoKnownTokenIsRefused) {
  const auto security = Load(WithTokens());
  for (const std::string& bad :
       {std::string(), std::string("Bearer"), std::string("Bearer "), std::string(kViewer), Bearer("wrong"),
        Bearer(kViewer) + " ", Bearer(std::string(kViewer) + "x"), "Basic " + std::string(kViewer),
        "Bearer" + std::string(kViewer)})
    EXPECT_EQ(CodeOf(security->Check(kGetArm, bad, kHere)), ErrorCode::kUnauthenticated) << bad;
  EXPECT_TRUE(security->Check(kGetArm, "bearer  " + std::string(kViewer), kHere).ok());
}

TEST_F(SecurityTest, TheTokenFileItselfIsNoToken) {
  const auto security = Load(WithTokens());
  const std::string line = TokenLine("eve", "viewer", kViewer);
  const std::string hash = line.substr(line.rfind(' ') + 1, 64);
  EXPECT_EQ(CodeOf(security->Check(kGetArm, Bearer(hash), kHere)), ErrorCode::kUnauthenticated);
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
  EXPECT_THAT(complaint("eve viewer " + std::string(64, 'a') + " more"), HasSubstr("expires="));
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

TEST_F(SecurityTest, WeakKeysAndSignaturesAreRefused) {
  const auto complaint = [this](TestKey kind, TestDigest digest = TestDigest::kSha256) {
    WritePair("server", authority_.Issue("server", 2, kind, digest));
    return Complaint(Tls());
  };
  EXPECT_THAT(complaint(TestKey::kRsa1024),
              AllOf(HasSubstr("server.pem"), HasSubstr("RSA key of 1024 bits"), HasSubstr("at least 2048")));
  EXPECT_THAT(complaint(TestKey::kP192), AllOf(HasSubstr("EC key of 192 bits"), HasSubstr("at least 256")));
  EXPECT_THAT(complaint(TestKey::kP256, TestDigest::kSha1),
              AllOf(HasSubstr("signed with SHA1"), HasSubstr("SHA-256")));
  EXPECT_EQ(complaint(TestKey::kRsa2048), "accepted");
  EXPECT_EQ(complaint(TestKey::kP256), "accepted");
  const std::string strong = authority_.Issue("other").certificate,
                    weak = authority_.Issue("weak", 2, TestKey::kRsa1024).certificate;
  Write("ca.pem", authority_.pem() + strong + weak);
  EXPECT_THAT(Complaint(MutualTls()), AllOf(HasSubstr("ca.pem (certificate 3)"), HasSubstr("1024 bits")));
}

TEST_F(SecurityTest, ExpiredCertificatesAreWarnedOf) {
  const auto warnings = [this] {
    const auto material = ReadTlsFiles(Tls());
    EXPECT_TRUE(material.ok());
    return TlsWarnings(Tls(), *material);
  };
  EXPECT_EQ(warnings(), "");
  WritePair("server", authority_.Issue("server", -1));
  EXPECT_THAT(warnings(), HasSubstr("has expired"));
}

TEST_F(SecurityTest, KeysAndTokensThatOthersMayUseAreRefused) {
  for (const unsigned mode : {0644U, 0604U, 0602U, 0666U}) {
    for (const char* name : {"server.key", "tokens"}) {
      SetMode(name, mode);
      EXPECT_THAT(Complaint(WithTokens(Tls())),
                  AllOf(HasSubstr(name), HasSubstr("every user"), HasSubstr("chmod 640"), HasSubstr("0440")));
      SetMode(name, 0600);
    }
  }
  for (const unsigned mode : {0640U, 0440U, 0400U, 0660U}) {
    SetMode("server.key", mode);
    SetMode("tokens", mode);
    EXPECT_EQ(Complaint(WithTokens(Tls())), "accepted") << std::oct << mode;
  }
  SetMode("tokens", 0666);
  SecurityConfig config = WithTokens();
  config.tokens_open = true;
  EXPECT_EQ(Complaint(config), "accepted");
}

TEST_F(SecurityTest, AGroupThatMayReadIsTheServersOwn) {
  TACLINK_REQUIRE(geteuid() == 0, "only root gives files to other groups: run the tests as root");
  constexpr gid_t kStrangers = 54321;
  for (const char* name : {"server.key", "tokens"}) {
    ASSERT_EQ(chown(Path(name).c_str(), getuid(), kStrangers), 0);
    EXPECT_EQ(Complaint(WithTokens(Tls())), "accepted") << "the group may do nothing with it";
    SetMode(name, 0640);
    EXPECT_THAT(Complaint(WithTokens(Tls())), AllOf(HasSubstr(name), HasSubstr("54321"), HasSubstr("chgrp")));
    ASSERT_EQ(chown(Path(name).c_str(), getuid(), 0), 0);
    EXPECT_EQ(Complaint(WithTokens(Tls())), "accepted") << "root's";
  }
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
  EXPECT_EQ(CodeOf(security->Check(kGetArm, Bearer(kViewer), kHere)), ErrorCode::kUnauthenticated);
  EXPECT_EQ(security->Check(kGetArm, Bearer("fresh"), kHere)->name, "new");
  Write("server.key", authority_.Issue("other").key);  // half of an exchange
  security->Reload();
  EXPECT_EQ(security->tls(), second);
  Write("tokens", TokenLine("otto", "operator", kOperator));
  security->Reload();
  EXPECT_EQ(CodeOf(security->Check(kGetArm, Bearer("fresh"), kHere)), ErrorCode::kUnauthenticated)
      << "tokens are withdrawn, whatever is wrong with the certificate";
}

class TokenFileTest : public SecurityTest {
 protected:
  // What can befall it.
  struct Fault {
    const char* name;
    std::function<void()> befall;
    const char* said;
  };
  std::vector<Fault> Faults() const {
    return {{"emptied", [this] { Write("tokens", ""); }, "holds no token"},
            {"gone", [this] { std::filesystem::remove(Path("tokens")); }, "cannot be read"},
            {"cut",
             [this] { std::filesystem::resize_file(Path("tokens"), TokenLine("", "viewer", "").size() - 9); },
             "64 hexadecimal digits"},
            {"overwritten", [this] { Write("tokens", std::string(512, '\0')); }, "tokens:1"},
            {"a folder",
             [this] {
               std::filesystem::remove(Path("tokens"));
               std::filesystem::create_directory(Path("tokens"));
               SetMode("tokens", 0700);
             },
             "a folder"},
            {"open to all", [this] { SetMode("tokens", 0666); }, "every user"},
            {"readable for all", [this] { SetMode("tokens", 0644); }, "every user"}};
  }
  void Mend() const {
    std::filesystem::remove_all(Path("tokens"));
    Write("tokens", TokenLine("eve", "viewer", kViewer) + TokenLine("otto", "operator", kOperator));
  }
};

TEST_F(TokenFileTest, WhileItIsInErrorNobodyIsLetInAndAllIsSaid) {
  const auto security = Load(WithTokens());
  std::vector<std::pair<bool, std::string>> heard;
  security->Listen([&](bool good, const std::string& what) { heard.emplace_back(good, what); });
  for (const Fault& fault : Faults()) {
    SCOPED_TRACE(fault.name);
    const LogCapture log;
    heard.clear();
    fault.befall();
    security->Reload();
    EXPECT_EQ(CodeOf(security->Check(kGetArm, Bearer(kOperator), kHere)), ErrorCode::kFailedPrecondition);
    EXPECT_EQ(security->Identify(Bearer(kOperator)).role, Role::kNobody);
    EXPECT_TRUE(security->Check("/readyz", "", kHere).ok());
    EXPECT_TRUE(security->Status().refuses_all);
    EXPECT_THAT(security->Status().trouble, AllOf(HasSubstr(fault.said), HasSubstr("until it is mended")));
    EXPECT_THAT(log.text(), HasSubstr(fault.said));
    ASSERT_EQ(heard.size(), 1u);
    EXPECT_FALSE(heard[0].first);
    EXPECT_THAT(heard[0].second, HasSubstr(fault.said));

    Mend();
    security->Reload();
    EXPECT_TRUE(security->Check(kGetArm, Bearer(kOperator), kHere).ok());
    EXPECT_EQ(security->Status().trouble, "");
    EXPECT_THAT(log.text(), HasSubstr("tokens: good again"));
    EXPECT_TRUE(heard.back().first);
  }
}

TEST_F(TokenFileTest, TokensStayInUseWhereThatIsConfigured) {
  SecurityConfig config = WithTokens();
  config.tokens_keep = true;
  const auto security = Load(config);
  for (const Fault& fault : Faults()) {
    SCOPED_TRACE(fault.name);
    fault.befall();
    security->Reload();
    EXPECT_TRUE(security->Check(kGetArm, Bearer(kOperator), kHere).ok());
    EXPECT_FALSE(security->Status().refuses_all);
    EXPECT_THAT(security->Status().trouble, AllOf(HasSubstr(fault.said), HasSubstr("stay in use")));
    Mend();
    security->Reload();
    EXPECT_EQ(security->Status().trouble, "");
  }
}

TEST_F(SecurityTest, TokensExpire) {
  ManualClock clock;
  const int64_t now_s = clock.UtcNs() / 1'000'000'000;
  Write("tokens", TokenLine("eve", "viewer", kViewer, " expires=" + UtcText(now_s + 10)) +
                      TokenLine("otto", "operator", kOperator, " expires=" + UtcText(now_s + 20)));
  const auto security = Load(WithTokens(), clock);
  EXPECT_TRUE(security->Check(kGetArm, Bearer(kViewer), kHere).ok());
  EXPECT_EQ(security->Status().next_expiry_utc_s, now_s + 10);

  const LogCapture log;
  clock.Advance(std::chrono::seconds(10));
  const auto late = security->Check(kGetArm, Bearer(kViewer), kHere);
  EXPECT_EQ(CodeOf(late), ErrorCode::kUnauthenticated);
  EXPECT_THAT(late.error().message, AllOf(HasSubstr("'eve' has expired at"), HasSubstr("a new one")));
  EXPECT_TRUE(security->Check(kGetArm, Bearer(kOperator), kHere).ok());
  EXPECT_EQ(security->Status().expired, 1u);
  EXPECT_EQ(security->Status().tries_expired, 1u);
  security->Reload();
  EXPECT_THAT(log.text(), HasSubstr("expired: eve"));

  clock.Advance(std::chrono::seconds(10));
  security->Reload();
  EXPECT_TRUE(security->Status().refuses_all);
  EXPECT_THAT(security->Status().trouble, HasSubstr("every token"));
  EXPECT_THAT(log.text(), HasSubstr("nobody is let in; add a new one"));
  EXPECT_EQ(security->Identify(Bearer(kOperator)).name, "");
}

TEST_F(SecurityTest, BadExpiriesAreNamed) {
  const std::string line = "eve viewer " + std::string(64, 'a');
  for (const char* bad : {"2027-01-31", "expires=", "expires=soon", "expires=2027-02-30", "expires=-1"}) {
    Write("tokens", line + " " + bad);
    EXPECT_THAT(Complaint(WithTokens()), HasSubstr("expires=2027-01-31T00:00:00Z")) << bad;
  }
  Write("tokens", line + "\notto operator " + std::string(64, 'A') + "\n");
  EXPECT_THAT(Complaint(WithTokens()), AllOf(HasSubstr("tokens:2: "), HasSubstr("same token as 'eve'")));
}

TEST_F(SecurityTest, WhoTriesTooOftenIsThrottledAndNobodyElse) {
  ManualClock clock;
  SecurityConfig config = WithTokens();
  config.max_failed_tries = 5;
  const auto security = Load(config, clock);
  int told = 0;
  security->Listen([&](bool good, const std::string& what) {
    ++told;
    EXPECT_FALSE(good);
    EXPECT_THAT(what, AllOf(HasSubstr("more than 5"), HasSubstr(kHere)));
  });
  const auto try_from = [&](const char* place) {
    return CodeOf(security->Check(kGetArm, Bearer("guess"), place));
  };
  for (int i = 0; i < 5; ++i) EXPECT_EQ(try_from(kHere), ErrorCode::kUnauthenticated);
  for (int i = 0; i < 200; ++i) {
    EXPECT_EQ(try_from(kHere), ErrorCode::kResourceExhausted);
    EXPECT_TRUE(security->Check(kCalibrate, Bearer(kOperator), kHere).ok())
        << "an operator at the same address";
  }
  EXPECT_EQ(told, 1);
  EXPECT_EQ(try_from("ipv4:192.0.2.2"), ErrorCode::kUnauthenticated);
  EXPECT_EQ(CodeOf(security->Check(kGetArm, "", kHere)), ErrorCode::kUnauthenticated) << "no guess";
  EXPECT_EQ(security->Status().tries_unknown, 206u);
  EXPECT_EQ(security->Status().tries_throttled, 200u);
  EXPECT_EQ(security->Status().tries_without, 1u);
  clock.Advance(std::chrono::seconds(60));
  EXPECT_EQ(try_from(kHere), ErrorCode::kUnauthenticated);
}

TEST_F(SecurityTest, AskingWhoOneIsGuessesToo) {
  const auto security = Load(WithTokens());
  EXPECT_TRUE(security->Check("/taclink.v1.OperationsService/GetCaller", Bearer("guess"), kHere).ok());
  EXPECT_EQ(security->Status().tries_unknown, 1u);
}

TEST_F(SecurityTest, WhatChangedIsToldWithoutSecrets) {
  const auto security = Load(WithTokens(Tls()));
  const auto changes = [&] {
    security->Reload();
    std::string out;
    for (const auto& change : security->TakeChanges()) out += change + "\n";
    return out;
  };
  EXPECT_EQ(changes(), "");
  Write("tokens",
        TokenLine("eve", "operator", kViewer) + TokenLine("new", "viewer", "fresh", " expires=2999-01-01"));
  const std::string told = changes();
  EXPECT_EQ(
      told,
      "tokens: eve (viewer) is now eve (operator), added new (viewer, until 2999-01-01T00:00:00Z), removed "
      "otto (operator)\n");
  WriteServer(authority_);
  EXPECT_EQ(changes(), "certificates: certificate, key reloaded\n");
  EXPECT_EQ(changes(), "") << "told once";
}

TEST_F(SecurityTest, ABadFileIsComplainedAboutOnce) {
  const LogCapture log;
  const auto security = Load(WithTokens());
  Write("tokens", "nonsense");
  security->Reload();
  const std::string once = log.text();
  EXPECT_THAT(once, AllOf(HasSubstr("tokens:1: "), HasSubstr("until it is mended")));
  security->Reload();
  EXPECT_EQ(log.text(), once);
}

}  // namespace
}  // namespace taclink::server

#include "server/security/exposure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/link/latency_histogram.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

Config Listening(const std::string& grpc, const std::string& http) {
  Config config;
  config.listen = grpc;
  config.http.listen = http;
  return config;
}

std::string Verdict(const Config& config, bool insecure_open = false) {
  const auto warnings = CheckExposure(config, insecure_open);
  if (!warnings) return warnings.error().message;
  std::string out;
  for (const auto& warning : *warnings) out += warning;
  return out;
}

TEST(Exposure, LoopbackNeedsNothing) {
  EXPECT_EQ(Verdict(Config()), "");
  EXPECT_EQ(Verdict(Listening("unix:/run/taclink", "")), "");
  EXPECT_EQ(Verdict(Listening("[::1]:50051", "localhost:80")), "");
}

TEST(Exposure, OtherAddressesNeedEncryptionAndAuthentication) {
  for (Config config : {Listening("0.0.0.0:50051", ""), Listening("127.0.0.1:1", "0.0.0.0:8080")}) {
    EXPECT_THAT(Verdict(config), HasSubstr("without encryption"));
    EXPECT_THAT(Verdict(config, true), HasSubstr("WITHOUT ENCRYPTION"));
    config.security.tokens = "tokens";
    EXPECT_THAT(Verdict(config, true), HasSubstr("could read the tokens")) << "not even with the flag";
    config.security.certificate = "server.pem";
    EXPECT_EQ(Verdict(config), "");
    config.security.tokens = "";
    EXPECT_THAT(Verdict(config), HasSubstr("for everyone"));
    EXPECT_THAT(Verdict(config, true), HasSubstr("WITHOUT AUTHENTICATION"));
    config.security.client_ca = "ca.pem";
    EXPECT_EQ(Verdict(config), "");
  }
}

TEST(LatencyHistogram, CountsInSteps) {
  LatencyHistogram histogram;
  for (const double ms : {0.05, 0.1, 0.11, 7.0, 5000.0}) histogram.Add(ms);
  const auto read = histogram.Read();
  EXPECT_EQ(read.counts.front(), 2u) << "a bound belongs to the step below it";
  EXPECT_EQ(read.counts[1], 1u);
  EXPECT_EQ(read.counts[6], 1u) << "5 to 10 ms";
  EXPECT_EQ(read.counts.back(), 1u);
  EXPECT_EQ(read.total(), 5u);
  EXPECT_NEAR(read.sum_ms, 5007.26, 1e-9);
}

}  // namespace
}  // namespace taclink::server

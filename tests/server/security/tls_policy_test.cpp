#include "server/security/tls_policy.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <string>

namespace taclink::server {
namespace {

constexpr const char* kVariable = "GRPC_SSL_CIPHER_SUITES";

class GrpcCiphers : public ::testing::Test {
 protected:
  GrpcCiphers() {
    if (const char* const value = std::getenv(kVariable)) before_ = value;
    ::unsetenv(kVariable);
  }
  ~GrpcCiphers() override { before_ ? ::setenv(kVariable, before_->c_str(), 1) : ::unsetenv(kVariable); }

 private:
  std::optional<std::string> before_;
};

TEST_F(GrpcCiphers, AreThoseOfTheGateway) {
  LimitGrpcCiphers();
  EXPECT_STREQ(std::getenv(kVariable), kTlsCiphers);
}

TEST_F(GrpcCiphers, AreTheEnvironmentsWhereItNamesSome) {
  ::setenv(kVariable, "ECDHE-RSA-AES256-GCM-SHA384", 1);
  LimitGrpcCiphers();
  EXPECT_STREQ(std::getenv(kVariable), "ECDHE-RSA-AES256-GCM-SHA384");
}

}  // namespace
}  // namespace taclink::server

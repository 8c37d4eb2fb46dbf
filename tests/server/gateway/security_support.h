#pragma once

#include <gtest/gtest.h>
#include <openssl/sha.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "server/security/security.h"
#include "tests/server/gateway/certificates.h"

namespace taclink::server {

/// `more`: what stands behind the hash.
inline std::string TokenLine(const std::string& name, const std::string& role, const std::string& token,
                             const std::string& more = "") {
  std::array<uint8_t, SHA256_DIGEST_LENGTH> hash{};
  SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
  std::string line = name + " " + role + " ";
  for (const uint8_t byte : hash) line += {"0123456789abcdef"[byte >> 4], "0123456789abcdef"[byte & 0xf]};
  return line + more + "\n";
}

/// A folder with what guards a server: tokens of a viewer and an operator, certificates of one authority.
class SecurityTest : public ::testing::Test {
 protected:
  static constexpr const char* kViewer = "token-of-a-viewer";
  static constexpr const char* kOperator = "token-of-an-operator";

  SecurityTest()
      : folder_(std::filesystem::temp_directory_path() /
                ("taclink_security." + std::to_string(getpid()) + "." +
                 ::testing::UnitTest::GetInstance()->current_test_info()->name())) {
    std::filesystem::create_directories(folder_);
    Write("tokens", TokenLine("eve", "viewer", kViewer) + TokenLine("otto", "operator", kOperator));
    WriteServer(authority_);
    Write("ca.pem", authority_.pem());
  }
  ~SecurityTest() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  /// For this user alone.
  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    SetMode(name, 0600);
  }
  void SetMode(const std::string& name, unsigned mode) const {
    std::filesystem::permissions(folder_ / name, std::filesystem::perms(mode));
  }
  void WriteServer(const TestAuthority& authority) const { WritePair("server", authority.Issue("server")); }
  void WritePair(const std::string& name, const PemPair& pair) const {
    Write(name + ".pem", pair.certificate);
    Write(name + ".key", pair.key);
  }

  SecurityConfig Tls() const {
    SecurityConfig config;
    config.certificate = Path("server.pem");
    config.key = Path("server.key");
    return config;
  }
  SecurityConfig MutualTls() const {
    SecurityConfig config = Tls();
    config.client_ca = Path("ca.pem");
    return config;
  }
  SecurityConfig WithTokens(SecurityConfig config = {}) const {
    config.tokens = Path("tokens");
    return config;
  }

  static std::shared_ptr<Security> Load(const SecurityConfig& config, Clock& clock = SystemClock()) {
    auto security = Security::Load(config, clock);
    EXPECT_TRUE(security.ok()) << security.error().message;
    return security ? *security : nullptr;
  }

  const TestAuthority authority_;

 private:
  const std::filesystem::path folder_;
};

}  // namespace taclink::server

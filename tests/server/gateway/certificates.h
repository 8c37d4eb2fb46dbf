#pragma once

#include <memory>
#include <string>

namespace taclink::server {

struct PemPair {
  std::string certificate;
  std::string key;
};

enum class TestKey { kP256, kP192, kRsa1024, kRsa2048 };
enum class TestDigest { kSha256, kSha1 };

/// Makes certificates for tests.
class TestAuthority {
 public:
  TestAuthority();
  ~TestAuthority();

  const std::string& pem() const { return pem_; }
  /// For localhost and 127.0.0.1; `days` from now (less than 0: expired).
  PemPair Issue(const std::string& name, int days = 2, TestKey kind = TestKey::kP256,
                TestDigest digest = TestDigest::kSha256) const;

 private:
  struct Keys;
  std::unique_ptr<Keys> keys_;
  std::string pem_;
};

}  // namespace taclink::server

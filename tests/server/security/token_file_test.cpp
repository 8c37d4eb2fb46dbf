// A token file that the machine cannot read for now: the tokens that were read stay in use.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/sha.h>
#include <sys/resource.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "server/security/security.h"
#include "tests/support/temporary_folder.h"

namespace taclink::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// While it lives this process can open no file: open(2) fails with EMFILE.
class NoDescriptors {
 public:
  NoDescriptors() {
    EXPECT_EQ(getrlimit(RLIMIT_NOFILE, &before_), 0);
    const rlimit none{.rlim_cur = 0, .rlim_max = before_.rlim_max};
    EXPECT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  }
  ~NoDescriptors() { EXPECT_EQ(setrlimit(RLIMIT_NOFILE, &before_), 0); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_{};
};

class UnreadableTokenFile : public ::testing::Test {
 protected:
  UnreadableTokenFile() {
    Write("otto operator " + HashOf("secret") + "\n");
    config_.tokens = path_;
    auto security = Security::Load(config_);
    EXPECT_TRUE(security.ok()) << security.error().message;
    security_ = *security;
  }
  void Write(const std::string& text) const {
    std::ofstream(path_) << text;
    std::filesystem::permissions(path_, std::filesystem::perms(0600));
  }
  static std::string HashOf(const std::string& token) {
    std::array<uint8_t, SHA256_DIGEST_LENGTH> hash{};
    SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
    std::string out;
    for (const uint8_t byte : hash) out += {"0123456789abcdef"[byte >> 4], "0123456789abcdef"[byte & 0xf]};
    return out;
  }
  bool IsLetIn() const {
    return security_->Check("/taclink.v1.TactileService/Calibrate", "Bearer secret", "test").ok();
  }
  void ReloadWithoutDescriptors() const {
    const NoDescriptors exhausted;
    security_->Reload();
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "tokens";
  SecurityConfig config_;
  std::shared_ptr<Security> security_;
};

TEST_F(UnreadableTokenFile, TokensStayInUseWithoutDescriptorsAndItIsSaid) {
  ReloadWithoutDescriptors();
  EXPECT_TRUE(IsLetIn());
  EXPECT_FALSE(security_->Status().refuses_all);
  EXPECT_THAT(security_->Status().trouble,
              AllOf(HasSubstr(path_), HasSubstr("LimitNOFILE"), HasSubstr("stay in use")));
  security_->Reload();
  EXPECT_EQ(security_->Status().trouble, "");
  EXPECT_TRUE(IsLetIn());
}

TEST_F(UnreadableTokenFile, TokensThatWereDroppedDoNotReturn) {
  Write("");
  security_->Reload();
  ReloadWithoutDescriptors();
  EXPECT_FALSE(IsLetIn());
  EXPECT_TRUE(security_->Status().refuses_all);
  EXPECT_THAT(security_->Status().trouble, HasSubstr("until it is mended"));
}

TEST_F(UnreadableTokenFile, AFileThatSaysSomethingElseDropsThem) {
  ReloadWithoutDescriptors();
  std::filesystem::remove(path_);
  security_->Reload();
  EXPECT_FALSE(IsLetIn()) << "gone";
  EXPECT_THAT(security_->Status().trouble,
              AllOf(HasSubstr("check the path"), HasSubstr("until it is mended")));
}

}  // namespace
}  // namespace taclink::server

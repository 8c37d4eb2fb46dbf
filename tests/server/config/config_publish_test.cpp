#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/config/config.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Result<Config> ParsePublish(const std::string& section) {
  return ParseConfig("arm.yaml",
                     "taclink_config: 1\n" + section +
                         "arm:\n  name: x\n  links:\n"
                         "    - {name: a, model: cylinder, source: simulated, scene: press}\n",
                     "/etc/taclink");
}

TEST(ConfigPublish, ReadsAndPrintsTheSame) {
  const auto config = ParsePublish(
      "publish: {url: 'tls://a:4222,nats://b:4222', site: lab-1, stream_mb: 10, tls_ca: ca.pem, token_file: "
      "/run/token, frames_detail: full, frames_rate_hz: 0, contacts_deadband_n: 0.1, queue_mb: 8}\n");
  ASSERT_TRUE(config.ok()) << config.error().message;
  const PublishConfig& publish = config->publish;
  EXPECT_EQ(publish.url, "tls://a:4222,nats://b:4222");
  EXPECT_EQ(publish.stream, "TACLINK_lab-1");
  EXPECT_EQ(publish.tls_ca, "/etc/taclink/ca.pem");
  EXPECT_EQ(publish.token_file, "/run/token");
  EXPECT_EQ(publish.frames_detail, Detail::kFull);
  EXPECT_EQ(publish.frames_rate_hz, 0);
  EXPECT_EQ(publish.queue_mb, 8);
  const std::string text = ConfigText(*config);
  const auto again = ParseConfig("again.yaml", text, "");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(ConfigText(*again), text);
}

TEST(ConfigPublish, IsOffUnlessTold) {
  EXPECT_TRUE(ParsePublish("")->publish.url.empty());
  EXPECT_THAT(ConfigText(*ParsePublish("")), Not(HasSubstr("publish")));
}

TEST(ConfigPublish, AUrlAloneIsEnough) {
  const auto config = ParsePublish("publish: nats://a:4222\n");
  ASSERT_TRUE(config.ok()) << config.error().message;
  EXPECT_EQ(ConfigText(*config), ConfigText(*ParsePublish("publish: {url: 'nats://a:4222'}\n")));
}

TEST(ConfigPublish, MistakesAreNamed) {
  for (const char* wrong :
       {"publish: on\n", "publish:\n", "publish: [a]\n", "publish: nats://me:secret@a\n", "publish: {}\n",
        "publish: {url: 'http://a'}\n", "publish: {url: 'nats://a,b'}\n", "publish: {url: 'nats://[::1'}\n",
        "publish: {url: 'nats://a:70000'}\n", "publish: {url: 'nats://me:secret@a'}\n",
        "publish: {url: 'nats://a', site: a.b}\n", "publish: {url: 'nats://a', stream: 'x y'}\n",
        "publish: {url: 'nats://a', certificate: c.pem}\n",
        "publish: {url: 'nats://a', frames_detail: most}\n", "publish: {url: 'nats://a', que_mb: 1}\n"}) {
    const auto config = ParsePublish(wrong);
    ASSERT_FALSE(config.ok()) << wrong;
    EXPECT_THAT(config.error().message, HasSubstr("arm.yaml:2")) << wrong;
  }
}

}  // namespace
}  // namespace taclink::server

#include "sensing/core/address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::string ComplaintOfNats(const std::string& urls) {
  const auto good = CheckNatsUrls(urls);
  return good ? "accepted" : good.error().message;
}

TEST(Address, HostAndPort) {
  const auto v6 = ParseHostPort("[fe80::1%eth0]:4222");
  ASSERT_TRUE(v6.ok()) << v6.error().message;
  EXPECT_EQ(v6->host, "fe80::1%eth0");
  EXPECT_EQ(v6->port, 4222);
  EXPECT_EQ(ParseHostPort("robot-1.lab_2.example.:0")->host, "robot-1.lab_2.example.");
  EXPECT_EQ(ParseHostPort("[::1]", 80)->port, 80);
  EXPECT_EQ(ParseHostPort("robot", 80)->port, 80);
}

TEST(Address, WhatIsWrongIsNamed) {
  const auto complaint = [](const std::string& address) {
    const auto parsed = ParseHostPort(address);
    return parsed ? "accepted" : parsed.error().message;
  };
  EXPECT_EQ(complaint("[::1"), "'[' has no ']'");
  EXPECT_EQ(complaint("[::1:80"), "'[' has no ']'");
  for (const char* bad : {"[]:1", "[1.2.3.4]:1", "[::1::2]:1", "[robot]:1", "[fe80::1%]:1", "[[::1]]:1"})
    EXPECT_THAT(complaint(bad), HasSubstr("IPv6")) << bad;
  EXPECT_THAT(complaint("::1:80"), HasSubstr("in brackets"));
  for (const char* bad : {"256.0.0.1:1", "1.2.3:1", "1:1", "1.2.3.4.:1"})
    EXPECT_THAT(complaint(bad), HasSubstr("IPv4")) << bad;
  for (const char* bad : {"a b:1", "a/b:1", "-a:1", "a..b:1", ".a:1", "a]:1", "r\xC3\xB6 bot:1", "*:1"})
    EXPECT_THAT(complaint(bad), HasSubstr("a host's name")) << bad;
  EXPECT_THAT(complaint(std::string(64, 'a') + ":1"), HasSubstr("a host's name"));
  for (const char* bad : {"", ":1"}) EXPECT_THAT(complaint(bad), HasSubstr("host is missing")) << bad;
  for (const char* bad : {"a", "[::1]"}) EXPECT_THAT(complaint(bad), HasSubstr("port is missing")) << bad;
  for (const char* bad :
       {"a:", "a:-1", "a:+1", "a:1x", "a: 1", "a:65536", "a:99999999999", "[::1]x:1", "[::1]1"})
    EXPECT_THAT(complaint(bad), HasSubstr("from 0 to 65535")) << bad;
}

TEST(Address, NatsUrlsAreOnesThatCanBeConnectedTo) {
  for (const char* good : {"", "nats://a", "tls://a:4222", "nats://[::1]",
                           "nats://[::1]:4222,tls://10.0.0.1:1", "nats://a:4222/"})
    EXPECT_EQ(ComplaintOfNats(good), "accepted") << good;
  for (const char* bad :
       {"nats://[::1", "nats://[::1:4222", "nats://::1:4222", "nats://", "tls://:4222", "nats://a:0",
        "nats://a:65536", "nats://a:b", "nats://a:", "nats://a//", "nats://a/b", "nats:///a",
        "nats://nats://a", "nats://a,", ",nats://a", "nats://a b", "http://a", "a"})
    EXPECT_THAT(ComplaintOfNats(bad), HasSubstr("nats://HOST:PORT")) << bad;
  EXPECT_THAT(ComplaintOfNats("nats://a,tls://[::1"), HasSubstr("not 'tls://[::1': '[' has no ']'"));
  EXPECT_THAT(ComplaintOfNats("http://me:secret@a"), AllOf(HasSubstr("password"), Not(HasSubstr("secret"))));
}

// gRPC would listen somewhere else, and take a unix socket's clients for this process.
TEST(Address, SchemesOfGrpcAreNoHosts) {
  for (const char* bad : {"dns:1", "ipv4:1", "unix-abstract:1", "vsock:1"}) {
    const auto checked = CheckListenAddress(bad);
    ASSERT_FALSE(checked.ok()) << bad;
    EXPECT_THAT(checked.error().message, HasSubstr("scheme"));
  }
  EXPECT_TRUE(CheckListenAddress("dns.example:1").ok());
}

}  // namespace
}  // namespace taclink

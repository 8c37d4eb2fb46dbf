#include "server/gateway/page_origin.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Headers = decltype(HttpRequest::headers);

HttpRequest WithHeaders(const std::string& method, Headers headers) {
  return {.method = method, .headers = std::move(headers)};
}

bool MayCall(Headers headers) {
  return !ForeignPage(WithHeaders("POST", std::move(headers)), false);
}

bool IsAnsweredAs(const std::string& host, bool http_1_0) {
  HttpRequest request{.method = "GET", .http_1_0 = http_1_0};
  if (!host.empty()) request.headers.emplace_back("host", host);
  return !ForeignPage(request, true);
}

TEST(PageOrigin, APageMayCallWhereItCameFrom) {
  EXPECT_TRUE(MayCall({{"host", "robot:8080"}, {"origin", "http://robot:8080"}}));
  EXPECT_TRUE(MayCall({{"host", "robot:8080"}})) << "no page";
  EXPECT_FALSE(MayCall({{"host", "robot:8080"}, {"origin", "http://evil.example"}}));
  EXPECT_FALSE(MayCall({{"host", "robot:8080"}, {"origin", "null"}}));
}

// nginx replaces the host by the one of proxy_pass.
TEST(PageOrigin, APageMayCallThroughAProxy) {
  const auto through = [](const std::string& name, const std::string& value) {
    return MayCall({{"host", "127.0.0.1:8080"}, {"origin", "https://robot.lan"}, {name, value}});
  };
  EXPECT_TRUE(through("sec-fetch-site", "same-origin"));
  EXPECT_TRUE(through("x-forwarded-host", "robot.lan"));
  EXPECT_TRUE(through("x-forwarded-host", "robot.lan , inner.lan"));
  EXPECT_FALSE(through("sec-fetch-site", "same-site"));
  EXPECT_FALSE(through("sec-fetch-site", "cross-site"));
  EXPECT_FALSE(through("x-forwarded-host", "other.lan, robot.lan"));
  EXPECT_FALSE(through("x-forwarded-host", ""));
}

TEST(PageOrigin, ScriptsOfThePageAreReadWhateverTheProxySays) {
  for (const char* method : {"GET", "HEAD"})
    EXPECT_FALSE(
        ForeignPage(WithHeaders(method, {{"host", "127.0.0.1"}, {"origin", "http://robot.lan"}}), true));
}

TEST(PageOrigin, ARefusalSaysWhatToConfigure) {
  const auto call =
      ForeignPage(WithHeaders("POST", {{"host", "127.0.0.1:8080"}, {"origin", "http://a\x01"}}), true);
  ASSERT_TRUE(call.has_value());
  EXPECT_EQ(call->status, 421) << "not 403, for which the page would ask for a token";
  EXPECT_THAT(call->message, AllOf(HasSubstr("'http://a\\x01'"), HasSubstr("'127.0.0.1:8080'"),
                                   HasSubstr("X-Forwarded-Host"), HasSubstr("docs/proxies.md")));
  const auto host = ForeignPage(WithHeaders("GET", {{"host", "robot.lan"}}), true);
  ASSERT_TRUE(host.has_value());
  EXPECT_THAT(host->message, AllOf(HasSubstr("'robot.lan'"), HasSubstr("security.tokens")));
}

TEST(PageOrigin, AForeignNameThatPointsHereIsRefused) {
  for (const bool http_1_0 : {false, true}) {
    EXPECT_TRUE(IsAnsweredAs("localhost:8080", http_1_0));
    EXPECT_FALSE(IsAnsweredAs("evil.example", http_1_0)) << "also through a proxy that speaks HTTP/1.0";
  }
  EXPECT_TRUE(IsAnsweredAs("", true));
  EXPECT_FALSE(ForeignPage(WithHeaders("GET", {{"host", "robot.lan"}}), false)) << "tokens guard it";
}

}  // namespace
}  // namespace taclink::server

#include "server/gateway/http_target.h"

#include <gtest/gtest.h>

namespace taclink::server {
namespace {

TEST(HttpTarget, PathsAreDecoded) {
  const auto path = [](const char* target) {
    const auto found = PathOfTarget(target);
    return found ? *found : "refused";
  };
  EXPECT_EQ(path("/"), "/");
  EXPECT_EQ(path("/index.html?x=../..#y"), "/index.html");
  EXPECT_EQ(path("/a%20b/%63.js"), "/a b/c.js");
  EXPECT_EQ(path("/assets/"), "/assets/");
  EXPECT_EQ(path("/r%c3%b8d.svg"),
            "/r\xc3\xb8"
            "d.svg");
}

TEST(HttpTarget, NothingLeadsOutOfTheRoot) {
  for (const char* bad : {"",
                          "a",
                          "*",
                          "http://host/a",
                          "/..",
                          "/../etc/passwd",
                          "/a/../b",
                          "/a/..",
                          "/%2e%2e/b",
                          "/.%2e/b",
                          "/a%2f..",
                          "/a%2fb",
                          "/.git/config",
                          "/a/.env",
                          "/./a",
                          "//etc/passwd",
                          "/a//b",
                          "/a\\..\\b",
                          "/a%5cb",
                          "/a%00.html",
                          "/a%0d%0ab",
                          "/%",
                          "/%4",
                          "/%zz",
                          "/a%7f",
                          "?/a",
                          "/\x01"})
    EXPECT_FALSE(PathOfTarget(bad).ok()) << bad;
}

TEST(HttpTarget, GzipOnlyForWhoTakesIt) {
  for (const char* yes : {"gzip", "gzip, deflate, br", "br;q=1.0, gzip;q=0.8", "deflate,gzip"})
    EXPECT_TRUE(TakesGzip(yes)) << yes;
  for (const char* no :
       {"", "br", "gzip;q=0", "gzip;q=0.0", "gzip; q=0.000", "x-gzip", "gzipped", "identity, *;q=0"})
    EXPECT_FALSE(TakesGzip(no)) << no;
}

TEST(HttpTarget, TypesAndCaching) {
  EXPECT_EQ(ContentTypeOf("/index.html"), "text/html; charset=utf-8");
  EXPECT_EQ(ContentTypeOf("/a/b.js"), "text/javascript; charset=utf-8");
  EXPECT_EQ(ContentTypeOf("/a.html.exe"), "application/octet-stream");
  EXPECT_EQ(ContentTypeOf("/README"), "application/octet-stream");
  for (const char* hashed : {"assets/index-BxX2a9Zk.js", "assets/style-D_4f-22a.css", "a-12345678.js.map"})
    EXPECT_TRUE(NameHoldsHash(hashed)) << hashed;
  for (const char* plain :
       {"index.html", "my-dashboard.js", "a-overview.js", "-BxX2a9Zk.js", "BxX2a9Zk-/a.js"})
    EXPECT_FALSE(NameHoldsHash(plain)) << plain;
}

TEST(HttpTarget, OriginsAndHosts) {
  EXPECT_TRUE(SameOrigin("http://robot:8080", "robot:8080"));
  EXPECT_TRUE(SameOrigin("https://robot", "robot"));
  for (const char* other :
       {"null", "http://evil", "http://robot:8080.evil", "ftp://robot:8080", "robot:8080", ""})
    EXPECT_FALSE(SameOrigin(other, "robot:8080")) << other;
  for (const char* here : {"localhost", "localhost:8080", "127.0.0.1:1", "127.1.2.3", "[::1]:80", "[::1]"})
    EXPECT_TRUE(IsLoopbackHost(here)) << here;
  for (const char* other :
       {"", "evil.example:8080", "localhost.evil", "127.0.0.1.evil", "127.evil", "[::1].evil"})
    EXPECT_FALSE(IsLoopbackHost(other)) << other;
}

}  // namespace
}  // namespace taclink::server

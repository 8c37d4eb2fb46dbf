#include "server/gateway/http_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

constexpr const char* kPost =
    "POST /a/b HTTP/1.1\r\nHost: here\r\nContent-Type: text/x\r\nContent-Length: 5\r\n\r\nhello";

// Gives the text in pieces of `step` bytes; what was not used is given again, with more.
struct Fed {
  explicit Fed(const std::string& text, size_t step = 1'000'000, HttpLimits limits = {}) : parser(limits) {
    for (size_t at = 0; at < text.size(); at += step) {
      left += text.substr(at, step);
      while (const size_t used = parser.Feed(left)) left.erase(0, used);
    }
  }
  HttpRequestParser parser;
  std::string left;
};

int FailureOf(const std::string& text, HttpLimits limits = {}) {
  const Fed fed(text, 1'000'000, limits);
  return fed.parser.failure() ? fed.parser.failure()->status : fed.parser.Done() ? 0 : -1;
}

TEST(HttpMessage, ARequestMayComeInAnyPieces) {
  for (const size_t step : {1, 2, 7, 1000}) {
    Fed fed(kPost, step);
    ASSERT_TRUE(fed.parser.Done()) << step;
    const HttpRequest request = fed.parser.Take();
    EXPECT_EQ(request.method, "POST");
    EXPECT_EQ(request.target, "/a/b");
    EXPECT_EQ(request.body, "hello");
    EXPECT_EQ(request.Header("content-type"), "text/x");
    EXPECT_EQ(request.Header("accept"), "");
    EXPECT_TRUE(request.keep_alive);
    EXPECT_FALSE(request.http_1_0);
    EXPECT_FALSE(fed.parser.begun()) << "ready for the next one";
  }
}

TEST(HttpMessage, RequestsFollowEachOther) {
  Fed fed(std::string(kPost) + "GET / HTTP/1.0\r\n\r\n");
  ASSERT_TRUE(fed.parser.Done());
  fed.parser.Take();
  EXPECT_EQ(fed.parser.Feed(fed.left), fed.left.size());
  ASSERT_TRUE(fed.parser.Done());
  const HttpRequest second = fed.parser.Take();
  EXPECT_EQ(second.method, "GET");
  EXPECT_TRUE(second.http_1_0);
  EXPECT_FALSE(second.keep_alive);
}

TEST(HttpMessage, BodiesInChunksAreRefused) {
  const std::string head = "POST /a HTTP/1.1\r\nHost: h\r\nTransfer-Encoding: chunked\r\n\r\n";
  EXPECT_EQ(FailureOf(head), 411);
  EXPECT_EQ(FailureOf(head + "2\r\nab\r\n0\r\n\r\n"), 411);
}

TEST(HttpMessage, BadRequestsAreRefused) {
  EXPECT_EQ(FailureOf("nonsense\r\n\r\n"), 400);
  EXPECT_EQ(FailureOf(std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11) + "\r\n\r\n"), 400)
      << "TLS on a plain port";
  EXPECT_EQ(FailureOf("GET / HTTP/2.0\r\nHost: h\r\n\r\n"), 505);
  EXPECT_EQ(FailureOf("GET / HTTP/1.1\r\n\r\n"), 400) << "no host";
  EXPECT_EQ(FailureOf("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"), 400);
  EXPECT_EQ(FailureOf("GET / HTTP/1.1\r\nHost: a\r\nAuthorization: a\r\nAuthorization: b\r\n\r\n"), 400);
  EXPECT_EQ(FailureOf("GET / HTTP/1.1\r\nHost : a\r\n\r\n"), 400);
  EXPECT_EQ(FailureOf("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: -1\r\n\r\n"), 400);
  EXPECT_EQ(FailureOf("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n"), 400);
  EXPECT_EQ(
      FailureOf("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n"), 400)
      << "two lengths: smuggling";
  EXPECT_EQ(FailureOf("POST / HTTP/1.1\r\nHost: a\r\nExpect: magic\r\nContent-Length: 1\r\n\r\n"), 417);
}

TEST(HttpMessage, HeadersThatDecideSomethingComeOnce) {
  for (const char* once :
       {"Authorization: Bearer ", "Content-Type: text/", "Origin: http://", "Grpc-Timeout: 1", "HOST: "}) {
    const std::string head =
        std::string("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 0\r\n") + once + "a\r\n";
    const bool second = std::string_view(once).starts_with("HOST");
    EXPECT_EQ(FailureOf(head + "\r\n"), second ? 400 : 0) << once;
    const Fed twice(head + once + "b\r\n\r\n");
    ASSERT_TRUE(twice.parser.failure().has_value()) << once;
    EXPECT_EQ(twice.parser.failure()->status, 400);
    EXPECT_THAT(twice.parser.failure()->message, HasSubstr("headers; send one"));
  }
  EXPECT_EQ(FailureOf("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 0\r\nContent-Length: 0\r\n\r\n"), 400);
  EXPECT_EQ(FailureOf("GET / HTTP/1.1\r\nHost: a\r\nAccept: a\r\nAccept: b\r\n\r\n"), 0) << "a list";
}

TEST(HttpMessage, LengthsAreBounded) {
  const HttpLimits limits{.header_bytes = 200, .body_bytes = 10};
  EXPECT_EQ(FailureOf("GET / HTTP/1.1\r\nHost: a\r\nX: " + std::string(300, 'x'), limits), 431)
      << "unfinished";
  EXPECT_EQ(FailureOf("GET /" + std::string(300, 'x'), limits), 431) << "unfinished first line";
  std::string many = "GET / HTTP/1.1\r\nHost: a\r\n";
  for (int i = 0; i < 40; ++i) many += "X: 1234567\r\n";
  EXPECT_EQ(FailureOf(many + "\r\n", limits), 431);
  EXPECT_EQ(FailureOf("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 11\r\n\r\n", limits), 413);
  EXPECT_EQ(FailureOf("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 10\r\n\r\n0123456789", limits), 0);
}

TEST(HttpMessage, ExpectContinueIsAskedOnce) {
  Fed fed("POST / HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\nContent-Length: 2\r\n\r\n");
  EXPECT_TRUE(fed.parser.TakeWantsContinue());
  EXPECT_FALSE(fed.parser.TakeWantsContinue());
  EXPECT_EQ(fed.parser.Feed("ab"), 2u);
  EXPECT_TRUE(fed.parser.Done());
}

// No crash, and no use of bytes that were not given. Not the fuzzer, but its first minute.
TEST(HttpMessage, SpoiltRequestsEndSomehow) {
  std::mt19937 random(3);
  for (int round = 0; round < 3000; ++round) {
    std::string text = std::string(kPost) + kPost;
    for (int i = 0; i < 3; ++i) text[random() % text.size()] = static_cast<char>(random());
    Fed fed(text, 1 + random() % 30);
    const size_t body = fed.parser.Done() ? fed.parser.Take().body.size() : 0;
    EXPECT_LE(body, HttpLimits().body_bytes);
    EXPECT_LE(fed.left.size(), text.size());
  }
}

TEST(HttpMessage, Responses) {
  EXPECT_EQ(ResponseHead(200, {{"A", "b"}}, 3, true),
            "HTTP/1.1 200 OK\r\nA: b\r\nContent-Length: 3\r\nConnection: keep-alive\r\n\r\n");
  EXPECT_EQ(ResponseHead(404, {}, 0, false),
            "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
}

TEST(HttpMessage, StreamsComeInChunks) {
  const StreamedResponse response(HttpRequest{.keep_alive = true});
  EXPECT_TRUE(response.keeps_alive());
  EXPECT_EQ(response.Head(200, {{"A", "b"}}),
            "HTTP/1.1 200 OK\r\nA: b\r\nTransfer-Encoding: chunked\r\nConnection: keep-alive\r\n\r\n");
  EXPECT_EQ(response.Piece(std::string(26, 'x')), "1a\r\n" + std::string(26, 'x') + "\r\n");
  EXPECT_EQ(response.End(), "0\r\n\r\n");
  EXPECT_THAT(StreamedResponse(HttpRequest{.keep_alive = false}).Head(200, {}),
              HasSubstr("Transfer-Encoding: chunked\r\nConnection: close\r\n"));
}

// A proxy that speaks HTTP/1.0, as nginx does unless it is told otherwise.
TEST(HttpMessage, StreamsToHttp10EndWithTheConnection) {
  for (const bool keep_alive : {false, true}) {
    const StreamedResponse response(HttpRequest{.http_1_0 = true, .keep_alive = keep_alive});
    EXPECT_FALSE(response.keeps_alive());
    EXPECT_EQ(response.Head(200, {}), "HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n");
    EXPECT_EQ(response.Piece("frame") + response.End(), "frame");
  }
}

}  // namespace
}  // namespace taclink::server

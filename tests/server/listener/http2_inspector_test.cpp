#include "server/listener/http2_inspector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/support/http2_frames.h"

namespace taclink::server {
namespace {

using namespace taclink::testing;
using ::testing::HasSubstr;

constexpr int64_t kStartNs = 1'000'000'000, kSecondNs = 1'000'000'000;

bool Feed(Http2Inspector& inspector, const std::string& bytes, int64_t now_ns = kStartNs,
          bool authorized = false) {
  return inspector.Feed(std::as_bytes(std::span(bytes)), now_ns, authorized);
}

std::string Times(int count, const std::string& bytes) {
  std::string out;
  for (int i = 0; i < count; ++i) out += bytes;
  return out;
}

const std::string kFourZeros(4, '\0');

// What clients send in ten minutes passes, whatever pieces it comes in.
TEST(Http2Inspector, OrdinaryTrafficPasses) {
  std::mt19937 random(1);
  Http2Inspector inspector;
  std::string bytes = Preface() + Frame(Http2Frame::kSettings, kAck, 0);
  uint32_t stream = 1;
  for (int second = 0; second < 600; ++second) {
    for (int i = 0; i < 20; ++i, stream += 2) {
      bytes += Frame(Http2Frame::kHeaders, 0, stream, std::string(16000, 'h')) +
               Frame(Http2Frame::kContinuation, kEndHeaders, stream, std::string(2000, 'h')) +
               Frame(Http2Frame::kData, kEndStream, stream, std::string(100, 'd')) +
               Frame(Http2Frame::kWindowUpdate, 0, 0, std::string("\0\0\1\0", 4));
    }
    bytes += Times(30, Frame(Http2Frame::kPing, kAck, 0, "12345678")) +
             Times(10, Frame(Http2Frame::kPing, 0, 0, "12345678")) +
             Times(20, Frame(Http2Frame::kReset, 0, stream, kFourZeros));
    while (bytes.size() > 40000) {
      const size_t piece = random() % 40000;
      ASSERT_TRUE(Feed(inspector, bytes.substr(0, piece), kStartNs + second * kSecondNs, true))
          << inspector.violation();
      bytes.erase(0, piece);
    }
  }
  EXPECT_EQ(inspector.violation(), "");
}

struct Flood {
  const char* name;
  std::string begin, repeated;
  const char* said;
  size_t most_bytes;  // until it is found
};

class FloodTest : public ::testing::TestWithParam<Flood> {};

TEST_P(FloodTest, IsFoundSoonAndForGood) {
  const Flood& flood = GetParam();
  for (const size_t piece : {size_t{1}, size_t{1000}, size_t{100'000}}) {
    Http2Inspector inspector;
    ASSERT_TRUE(Feed(inspector, Preface() + flood.begin));
    size_t fed = 0;
    std::string bytes;
    while (fed < flood.most_bytes) {
      while (bytes.size() < piece) bytes += flood.repeated;
      if (!Feed(inspector, bytes.substr(0, piece))) break;
      fed += piece;
      bytes.erase(0, piece);
    }
    EXPECT_LT(fed, flood.most_bytes);
    EXPECT_THAT(inspector.violation(), HasSubstr(flood.said));
    EXPECT_FALSE(Feed(inspector, Frame(Http2Frame::kPing, kAck, 0, "12345678"), kStartNs + 3600 * kSecondNs));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Http2, FloodTest,
    ::testing::Values(
        Flood{"Continuations", Frame(Http2Frame::kHeaders, 0, 1, CallFields("/x")),
              Frame(Http2Frame::kContinuation, 0, 1, Field("a", std::string(100, 'b'))), "CONTINUATION",
              2000},
        Flood{"EmptyContinuations", Frame(Http2Frame::kHeaders, 0, 1), Frame(Http2Frame::kContinuation, 0, 1),
              "CONTINUATION", 200},
        Flood{"LargeContinuations", Frame(Http2Frame::kHeaders, 0, 1),
              Frame(Http2Frame::kContinuation, 0, 1, std::string(16384, '\0')), "header block of", 100'000},
        Flood{"OneLargeHeader", Frame(Http2Frame::kSettings, 0, 0),
              Frame(Http2Frame::kHeaders, kEndHeaders, 1, std::string(1 << 20, 'x')), "header block of", 20},
        Flood{"RapidReset", "",
              Frame(Http2Frame::kHeaders, kEndHeaders, 1, CallFields("/x")) +
                  Frame(Http2Frame::kReset, 0, 1, kFourZeros),
              "per second", 50'000},
        Flood{"ResetByEmptyWindowUpdate", "",
              Frame(Http2Frame::kHeaders, kEndHeaders, 1, CallFields("/x")) +
                  Frame(Http2Frame::kWindowUpdate, 0, 1, kFourZeros),
              "per second", 50'000},
        Flood{"Settings", "", Frame(Http2Frame::kSettings, 0, 0), "per second", 20'000},
        Flood{"Pings", "", Frame(Http2Frame::kPing, 0, 0, "12345678"), "per second", 200'000},
        Flood{"Priorities", "", Frame(Http2Frame::kPriority, 0, 1, "12345"), "per second", 20'000},
        Flood{"EmptyData", Frame(Http2Frame::kHeaders, kEndHeaders, 1), Frame(Http2Frame::kData, 0, 1),
              "per second", 20'000},
        Flood{"WindowUpdates", "", Frame(Http2Frame::kWindowUpdate, 0, 0, std::string("\0\0\0\1", 4)),
              "per second", 500'000},
        Flood{"SmallData", Frame(Http2Frame::kHeaders, kEndHeaders, 1), Frame(Http2Frame::kData, 0, 1, "x"),
              "per second", 100'000},
        Flood{"Unknown", "", Frame(Http2Frame::kUnknown, 0, 1), "per second", 20'000}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(Http2Inspector, ManyCallsAreForThoseWhoMay) {
  const std::string calls =
      Times(5000, Frame(Http2Frame::kHeaders, kEndHeaders | kEndStream, 1, CallFields("/x")));
  Http2Inspector stranger, caller;
  EXPECT_FALSE(Feed(stranger, Preface() + calls));
  EXPECT_THAT(stranger.violation(), HasSubstr("authorized"));
  EXPECT_TRUE(Feed(caller, Preface() + calls, kStartNs, true)) << caller.violation();
  // Somebody without a token who asks for the server's health ten times a second.
  Http2Inspector monitor;
  for (int second = 0; second < 600; ++second)
    ASSERT_TRUE(Feed(monitor, second == 0 ? Preface() : calls.substr(0, calls.size() / 500),
                     kStartNs + second * kSecondNs))
        << monitor.violation();
}

TEST(Http2Inspector, ResetsAreAllowedAgainWithTime) {
  Http2Inspector inspector({.reset_burst = 10, .resets_per_s = 5});
  const std::string reset = Frame(Http2Frame::kReset, 0, 1, kFourZeros);
  ASSERT_TRUE(Feed(inspector, Preface() + Times(10, reset)));
  EXPECT_TRUE(Feed(inspector, Times(5, reset), kStartNs + kSecondNs));
  EXPECT_FALSE(Feed(inspector, reset, kStartNs + kSecondNs));
}

}  // namespace
}  // namespace taclink::server

#include "server/gateway/grpc_web.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string Bytes(std::initializer_list<int> values) {
  std::string out;
  for (const int value : values) out += static_cast<char>(value);
  return out;
}

TEST(GrpcWeb, Formats) {
  EXPECT_EQ(WebFormatOf("application/grpc-web"), WebFormat::kBinary);
  EXPECT_EQ(WebFormatOf("application/grpc-web+proto; charset=x"), WebFormat::kBinary);
  EXPECT_EQ(WebFormatOf("application/grpc-web-text"), WebFormat::kText);
  for (const char* other :
       {"", "application/grpc", "application/json", "application/grpc-web+json", "text/plain"})
    EXPECT_FALSE(WebFormatOf(other).has_value()) << other;
}

TEST(GrpcWeb, MethodPaths) {
  EXPECT_TRUE(IsMethodPath("/taclink.v1.TactileService/GetArm"));
  for (const char* other :
       {"", "/", "/a", "/a/", "//a", "a/b", "/a/b/c", "/a/b?x", "/a/..%2f", "/a b/c", "/a/\r\n"})
    EXPECT_FALSE(IsMethodPath(other)) << other;
}

TEST(GrpcWeb, AFrameIsFlagLengthAndBytes) {
  EXPECT_EQ(EncodeMessage(WebFormat::kBinary, "abc"), Bytes({0, 0, 0, 0, 3}) + "abc");
  const std::string large(70'000, 'x');
  EXPECT_EQ(EncodeMessage(WebFormat::kBinary, large).substr(0, 5), Bytes({0, 0, 1, 0x11, 0x70}));
  EXPECT_EQ(EncodeTrailers(WebFormat::kBinary, {.code = 5, .message = "no link 'a'\n50%"}),
            Bytes({0x80, 0, 0, 0, 51}) + "grpc-status: 5\r\ngrpc-message: no link 'a'%0A50%25\r\n");
  EXPECT_EQ(EncodeTrailers(WebFormat::kBinary, {}), Bytes({0x80, 0, 0, 0, 16}) + "grpc-status: 0\r\n");
}

TEST(GrpcWeb, MessagesAreReadBack) {
  for (const WebFormat format : {WebFormat::kBinary, WebFormat::kText}) {
    const std::string body =
        EncodeMessage(format, "") + EncodeMessage(format, "ab") + EncodeMessage(format, "cdefg");
    const auto messages = DecodeMessages(format, body);
    ASSERT_TRUE(messages.ok()) << messages.error().message;
    EXPECT_THAT(*messages, ElementsAre("", "ab", "cdefg"));
  }
  EXPECT_THAT(*DecodeMessages(WebFormat::kBinary, ""), ElementsAre());
}

TEST(GrpcWeb, BadBodiesAreRefused) {
  const auto complaint = [](const std::string& body) {
    const auto messages = DecodeMessages(WebFormat::kBinary, body);
    return messages ? "accepted" : messages.error().message;
  };
  EXPECT_THAT(complaint(Bytes({0})), HasSubstr("within a frame's head"));
  EXPECT_THAT(complaint(Bytes({0, 0, 0, 0, 2, 7})), HasSubstr("within a message"));
  EXPECT_THAT(complaint(Bytes({0, 0xff, 0xff, 0xff, 0xff, 7})), HasSubstr("within a message"));
  EXPECT_THAT(complaint(Bytes({1, 0, 0, 0, 0})), HasSubstr("compressed"));
  EXPECT_THAT(complaint(Bytes({0x80, 0, 0, 0, 0})), HasSubstr("no message"));
  EXPECT_THAT(complaint(Bytes({2, 0, 0, 0, 0})), HasSubstr("no message"));
}

TEST(GrpcWeb, Base64RoundTripAndBadText) {
  std::mt19937 random(5);
  for (size_t size = 0; size < 70; ++size) {
    std::string bytes(size, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    EXPECT_EQ(*DecodeBase64(EncodeBase64(bytes)), bytes);
  }
  EXPECT_EQ(EncodeBase64("Man is"), "TWFuIGlz");  // RFC 4648 and its kin
  EXPECT_EQ(EncodeBase64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(*DecodeBase64("Zg==Zm8="), "ffo") << "pieces padded one by one";
  for (const char* bad : {"Z", "Zm9", "Zm9*", "=m9v", "Z=9v", "Zm=v", "===="})
    EXPECT_FALSE(DecodeBase64(bad).ok()) << bad;
}

TEST(GrpcWeb, Timeouts) {
  using std::chrono::nanoseconds;
  EXPECT_EQ(ParseGrpcTimeout("10S"), std::chrono::seconds(10));
  EXPECT_EQ(ParseGrpcTimeout("1H"), std::chrono::hours(1));
  EXPECT_EQ(ParseGrpcTimeout("250m"), std::chrono::milliseconds(250));
  EXPECT_EQ(ParseGrpcTimeout("99999999n"), nanoseconds(99'999'999));
  for (const char* bad : {"", "S", "10", "-1S", "1.5S", "10s", "123456789S", "99999999H", " 1S", "1 S"})
    EXPECT_FALSE(ParseGrpcTimeout(bad).has_value()) << bad;
}

}  // namespace
}  // namespace taclink::server

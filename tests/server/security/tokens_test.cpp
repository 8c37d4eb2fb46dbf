#include "server/security/tokens.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/sha.h>

#include <string>

namespace taclink::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// The token is NAME-secret.
std::string LineOf(const std::string& name, const std::string& more = "") {
  const std::string token = name + "-secret";
  std::array<uint8_t, SHA256_DIGEST_LENGTH> hash{};
  SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
  std::string line = name + " viewer ";
  for (const uint8_t byte : hash) line += {"0123456789abcdef"[byte >> 4], "0123456789abcdef"[byte & 0xf]};
  return line + more + "\n";
}

Tokens ParseGood(const std::string& text) {
  auto tokens = Tokens::Parse("tokens", text);
  EXPECT_TRUE(tokens.ok()) << tokens.error().message;
  return tokens ? *tokens : Tokens();
}

std::string ComplaintOf(const std::string& text) {
  const auto tokens = Tokens::Parse("tokens", text);
  return tokens ? "accepted" : tokens.error().message;
}

TEST(Tokens, NamesAreNamesAsEverywhere) {
  for (const std::string bad : {"-eve", ".eve", "e/ve", "e\x1b[31mve",
                                "\xEF\xBB\xBF"
                                "eve",
                                "e\xE2\x80\xAEve"})
    EXPECT_THAT(ComplaintOf("# who\n" + LineOf(bad)), AllOf(HasSubstr("tokens:2: the name must be"))) << bad;
  EXPECT_THAT(ComplaintOf(LineOf(std::string(65, 'e'))), HasSubstr("1 to 64 letters"));
  EXPECT_EQ(ComplaintOf(LineOf(std::string(64, 'e')) + LineOf("otto_1.a-b")), "accepted");
}

TEST(Tokens, LinesEndAsAnyEditorEndsThem) {
  const std::string crlf = "# a\r\n\r\n \t \r\n" + LineOf("eve", " # her robot\r") + LineOf("otto", "\r");
  EXPECT_EQ(ParseGood(crlf).entries().size(), 2u);
  const std::string line = LineOf("eve");
  EXPECT_EQ(ParseGood(line.substr(0, line.size() - 1)).entries().size(), 1u) << "no newline at the end";
  EXPECT_THAT(ComplaintOf("\n\n" + line + line), HasSubstr("tokens:4: is the same token as 'eve'"));
}

// With a look-up that is linear in the number of tokens this takes minutes.
TEST(Tokens, AHundredThousandAreReadComparedAndFound) {
  constexpr int kCount = 100'000;
  std::string text, next;
  for (int i = 0; i < kCount; ++i) {
    const std::string line = LineOf("robot" + std::to_string(i), " expires=2030-01-01");
    text += line;
    if (i % 2 == 0) next += line;
  }
  const Tokens before = ParseGood(text), after = ParseGood(next + LineOf("new"));
  EXPECT_EQ(before.entries().size(), size_t{kCount});
  for (int i = 0; i < kCount; i += 10) {
    const std::string name = "robot" + std::to_string(i);
    const Tokens::Entry* const found = before.Find(name + "-secret");
    ASSERT_NE(found, nullptr);
    EXPECT_EQ(found->caller.name, name);
  }
  EXPECT_EQ(before.Find("robot0-secre"), nullptr);
  EXPECT_EQ(before.Find(""), nullptr);
  EXPECT_THAT(TokenChanges(before, after),
              AllOf(HasSubstr("added new (viewer), removed robot1 (viewer, until 2030-01-01T00:00:00Z)"),
                    HasSubstr(" and 49993 more")));
  EXPECT_EQ(TokenChanges(before, before), "");
  const int64_t year_2029_s = 1'861'920'000, year_2031_s = 1'924'992'000;
  EXPECT_THAT(ExpiredBetween(before, year_2029_s, year_2031_s),
              AllOf(HasSubstr("expired: robot0, robot1, "), HasSubstr("robot7 and 99992 more")));
  EXPECT_EQ(ExpiredBetween(before, year_2031_s, year_2031_s), "");
}

}  // namespace
}  // namespace taclink::server

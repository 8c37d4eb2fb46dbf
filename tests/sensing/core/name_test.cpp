#include "sensing/core/name.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace taclink {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Name, IsOneHarmlessWord) {
  const std::string longest(64, 'n');
  for (const std::string& good : {std::string("a"), std::string("Arm_2-left.v1"), std::string("_"), longest})
    EXPECT_TRUE(CheckName(good).ok()) << good;
  for (const std::string& bad :
       {std::string(), std::string("-rf"), std::string(".hidden"), std::string(".."), std::string("a b"),
        std::string("a/b"), std::string("a\nb"), std::string("a\x1b[2J"), std::string("a\0b", 3),
        std::string("a\x7f"), std::string("\xc3\xa9"), std::string("a;rm"), std::string("$(x)"),
        longest + "n"}) {
    const auto checked = CheckName(bad);
    ASSERT_FALSE(checked.ok()) << bad;
    EXPECT_EQ(checked.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(checked.error().message.find_first_of("\n\x1b\x7f"), std::string::npos);
    EXPECT_LT(checked.error().message.size(), 200u);
  }
  EXPECT_THAT(CheckName("-rf").error().message, HasSubstr("not '-rf'"));
}

TEST(Name, PartsOfSubjectsHaveNoDots) {
  EXPECT_TRUE(CheckSubjectPart("site-1").ok());
  EXPECT_FALSE(CheckSubjectPart("site.1").ok());
  EXPECT_FALSE(CheckSubjectPart("*").ok());
  EXPECT_FALSE(CheckSubjectPart("-site").ok());
}

TEST(Note, IsTextThatNoTerminalObeys) {
  for (const char* good : {"", "two\nlines\tand a tab",
                           "Gr\xc3\xb6\xc3\x9f"
                           "e, \xe6\x9d\xb1"})
    EXPECT_TRUE(CheckNote(good).ok()) << good;
  EXPECT_TRUE(CheckNote(std::string(4096, 'x')).ok());
  EXPECT_THAT(CheckNote(std::string(4097, 'x')).error().message, HasSubstr("4097"));
  for (const char* bad : {"\x1b[2J",
                          "\xe2\x80\xae"
                          "abc",
                          "\xe2\x80\xa8", "\xff", "bell\a", "back\r", "\x7f",
                          "\xc2\x9b"
                          "2J"})
    EXPECT_FALSE(CheckNote(bad).ok());
}

}  // namespace
}  // namespace taclink

#include "sensing/core/printable.h"

#include <gtest/gtest.h>

namespace taclink {
namespace {

TEST(Printable, ControlsAreEscapedAndTextIsNot) {
  EXPECT_EQ(Printable("frames arrive, 5 °C – ok 🤖"), "frames arrive, 5 °C – ok 🤖");
  EXPECT_EQ(Printable("a\nb\r\tc"), "a\\nb\\r\\tc");
  EXPECT_EQ(Printable("\x1b[2J\x07\x7f"), "\\x1b[2J\\x07\\x7f");
  EXPECT_EQ(Printable(std::string("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "31m"),
            "\\u009b31m")
      << "a control of C1 begins a sequence, too";
  EXPECT_EQ(Printable("\xe2\x80\xa8\xe2\x80\xa9"), "\\u2028\\u2029");
  EXPECT_EQ(Printable("\xe2\x80\xae"), "\\u202e") << "turns the direction of writing";
}

TEST(Printable, WhatIsNoUtf8IsEscapedByteByByte) {
  EXPECT_EQ(Printable("\xff"), "\\xff");
  EXPECT_EQ(Printable("\x9b"), "\\x9b") << "C1, as a terminal without UTF-8 has it";
  EXPECT_EQ(Printable("\xc3"), "\\xc3") << "cut off";
  EXPECT_EQ(Printable("\xe2\x80"), "\\xe2\\x80");
  EXPECT_EQ(Printable("\xc0\x8a"), "\\xc0\\x8a") << "overlong";
  EXPECT_EQ(Printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "half of a surrogate pair";
  EXPECT_EQ(Printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "past the last code";
  EXPECT_EQ(Printable("\xc3\n"), "\\xc3\\n") << "no character takes the newline in";
}

TEST(Printable, WhatIsCutOffIsTold) {
  EXPECT_EQ(Printable("abc", 3), "abc");
  EXPECT_EQ(Printable(std::string(1300, 'x'), 10), "xxxxxxxxxx… 1,290 bytes more");
  EXPECT_EQ(Printable("ab°cdef", 3), "ab… 6 bytes more") << "characters stay whole";
  EXPECT_EQ(Printable(std::string(9, '\x80'), 8), "\\x80\\x80\\x80\\x80… 5 bytes more");
}

TEST(Printable, NumbersHaveCommas) {
  EXPECT_EQ(WithCommas(0), "0");
  EXPECT_EQ(WithCommas(999), "999");
  EXPECT_EQ(WithCommas(1234), "1,234");
  EXPECT_EQ(WithCommas(1234567), "1,234,567");
}

}  // namespace
}  // namespace taclink

#include "sensing/core/utc_time.h"

#include <gtest/gtest.h>

namespace taclink {
namespace {

TEST(UtcTime, ReadsWhatItWrites) {
  EXPECT_EQ(ParseUtc("1970-01-01"), 0);
  EXPECT_EQ(ParseUtc("2027-01-31T00:00:00Z"), 1801353600);
  EXPECT_EQ(ParseUtc("2027-01-31"), 1801353600);
  EXPECT_EQ(UtcText(1801353600), "2027-01-31T00:00:00Z");
  EXPECT_EQ(UtcText(*ParseUtc("2028-02-29T23:59:58Z")), "2028-02-29T23:59:58Z");
}

TEST(UtcTime, WhatIsNoTimeIsNone) {
  for (const char* bad : {"", "soon", "2027", "2027-1-31", "2027-02-30", "2027-13-01", "2027-01-31T00:00:00",
                          "2027-01-31 00:00:00Z", "2027-01-31T24:00:00Z", "2027-01-31T00:60:00Z",
                          "2027-01-31T00:00:00+01:00", "-027-01-31", "2027-01-31T00:00:-1Z"})
    EXPECT_EQ(ParseUtc(bad), std::nullopt) << bad;
}

}  // namespace
}  // namespace taclink

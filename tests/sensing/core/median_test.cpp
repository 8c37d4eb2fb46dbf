#include "sensing/core/median.h"

#include <gtest/gtest.h>

namespace taclink {
namespace {

TEST(Median, IsTheMiddleOneOrTheUpperOfTwo) {
  std::vector<double> none, one{3}, two{5, -1}, many{9, 1, 8, 2, 7};
  EXPECT_EQ(Median(none), 0);
  EXPECT_EQ(Median(one), 3);
  EXPECT_EQ(Median(two), 5);
  EXPECT_EQ(Median(many), 7);
}

}  // namespace
}  // namespace taclink

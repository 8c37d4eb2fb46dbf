#include "sensing/estimation/load_columns.h"

#include <gtest/gtest.h>

namespace taclink {
namespace {

TEST(LoadColumns, AreThoseThatWereAskedForInAnyOrder) {
  const Eigen::MatrixXf all = Eigen::MatrixXf::Random(30, 6);
  LoadColumns columns;
  columns.Clear(6, 30);
  EXPECT_FALSE(columns.Has(3));
  EXPECT_EQ(columns.columns().rows(), 30);
  columns.Append(std::vector{4, 1}, all(Eigen::all, {4, 1}));
  columns.Append(std::vector{5}, all.col(5));
  EXPECT_TRUE(columns.Has(1));
  EXPECT_FALSE(columns.Has(0));
  EXPECT_FALSE(columns.HasAll());
  columns.Append(std::vector{0, 2, 3}, all(Eigen::all, {0, 2, 3}));
  EXPECT_TRUE(columns.HasAll());
  EXPECT_EQ(columns.Places(std::vector{0, 4, 3}), (std::vector{3, 0, 5}));
  const Eigen::MatrixXf expected = all.transpose() * all;
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(columns.Column(i), all.col(i));
    for (int j = 0; j < 6; ++j)
      EXPECT_NEAR(columns.gram()(columns.Place(i), columns.Place(j)), expected(i, j), 1e-4);
  }
  columns.Clear(6, 30);
  EXPECT_FALSE(columns.Has(4));
}

}  // namespace
}  // namespace taclink

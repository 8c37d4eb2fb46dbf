#include "sensing/simulation/contact_balance.h"

#include <gtest/gtest.h>

namespace taclink {
namespace {

ContactMatrix TwoNeighbours() {
  ContactMatrix c(2, 2);
  c << 40, 10, 10, 40;  // mm per N
  return c;
}

TEST(ContactBalance, DepthIsHeldBesideAGivenForce) {
  ContactDemands demands;
  demands[0] = {.by_depth = true, .depth_mm = 6, .pressed = 1, .most_depth_mm = 20};
  demands[1] = {.force_n = 0.1, .most_depth_mm = 20};
  const auto forces = BalanceContacts(demands, TwoNeighbours(), ContactVector::Constant(2, -2.0));
  EXPECT_NEAR(-2 + 40 * forces[0].force_n + 10 * forces[1].force_n, 6, 1e-9);
  EXPECT_EQ(forces[1].force_n, 0.1);
  EXPECT_FALSE(forces[0].limited);
}

TEST(ContactBalance, NothingPulls) {
  ContactDemands demands;
  demands[0] = {.by_depth = true, .depth_mm = 1, .pressed = 1, .most_depth_mm = 20};
  demands[1] = {.by_depth = true, .depth_mm = 12, .pressed = 1, .most_depth_mm = 20};
  const auto forces = BalanceContacts(demands, TwoNeighbours(), ContactVector::Zero(2));
  EXPECT_EQ(forces[0].force_n, 0);
  EXPECT_NEAR(forces[1].force_n, 12.0 / 40, 1e-9);
}

TEST(ContactBalance, BeginsWhereTheSkinIs) {
  ContactDemands demands;
  demands[0] = {.by_depth = true, .depth_mm = 5, .pressed = 0, .most_depth_mm = 20};
  const auto forces =
      BalanceContacts(demands, ContactMatrix::Constant(1, 1, 40), ContactVector::Constant(1, -4.0));
  EXPECT_NEAR(forces[0].force_n, 0, 1e-12);
}

TEST(ContactBalance, StopsAtTheTube) {
  ContactDemands demands;
  demands[0] = {.force_n = 3, .most_depth_mm = 20};
  demands[1] = {.by_depth = true, .depth_mm = 50, .pressed = 1, .most_depth_mm = 20};
  const auto forces = BalanceContacts(demands, TwoNeighbours(), ContactVector::Zero(2));
  EXPECT_TRUE(forces[0].limited);
  EXPECT_TRUE(forces[1].limited);
  EXPECT_NEAR(forces[0].force_n, 0.4, 1e-9);
  EXPECT_NEAR(forces[1].force_n, 0.4, 1e-9);
}

}  // namespace
}  // namespace taclink

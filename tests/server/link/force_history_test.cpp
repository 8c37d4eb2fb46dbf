#include "server/link/force_history.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

constexpr int64_t kBegin = 1'700'000'000'000'000'000;

LinkState Pressed(int64_t utc_ns, double force_n, uint64_t contact = 7) {
  LinkState state;
  state.times.exposure_utc_ns = utc_ns;
  state.forces.forces_n.assign(3, Vec3::Zero());
  state.status = LinkStatus::kOk;
  state.forces.converged = true;
  state.total_force_n = Vec3(0, -force_n, 0);
  state.contacts.emplace_back().id = contact;
  state.contacts[0].force_n = state.total_force_n;
  return state;
}

std::vector<double> Totals(const ForceHistory& history, int64_t since_ns = 0) {
  std::vector<double> totals;
  for (const ForceSample& sample : history.Since(since_ns)) totals.push_back(sample.total_n);
  return totals;
}

// A touch that is shorter than a bin is not lost among frames without one.
TEST(ForceHistoryTest, KeepsTheStrongestFrameOfEachBin) {
  ForceHistory history;
  history.Add(Pressed(kBegin, 0.1));
  history.Add(Pressed(kBegin + ForceHistory::kBinNs / 3, 0.5, 8));
  history.Add(Pressed(kBegin + ForceHistory::kBinNs / 2, 0.2));
  history.Add(Pressed(kBegin + ForceHistory::kBinNs, 0.3));
  EXPECT_THAT(Totals(history), ElementsAre(0.5, 0.3));
  const ForceSample first = history.Since(0)[0];
  EXPECT_EQ(first.exposure_utc_ns, kBegin + ForceHistory::kBinNs / 3);
  ASSERT_EQ(first.contacts, 1u);
  EXPECT_THAT(first.contacts_n[0], Pair(8u, 0.5));
  EXPECT_EQ(history.newest_utc_ns(), kBegin + ForceHistory::kBinNs);
}

// A squeeze: the resultants cancel, what presses does not.
TEST(ForceHistoryTest, OppositeContactsDoNotCancel) {
  ForceHistory history;
  LinkState state = Pressed(kBegin, 0.75);
  state.contacts.push_back(state.contacts[0]);
  state.contacts[1].id = 8;
  state.contacts[1].force_n *= -1;
  state.total_force_n.setZero();
  Contact& ring = state.contacts.emplace_back();
  ring.id = 9;
  ring.normal_force_n = 0.5;
  history.Add(state);
  EXPECT_THAT(Totals(history), ElementsAre(2.0));
  EXPECT_THAT(history.Since(0)[0].contacts_n[2], Pair(9u, 0.5));
}

TEST(ForceHistoryTest, WhatIsNotMeasuredIsNoForce) {
  ForceHistory history;
  LinkState lost;
  history.Add(lost);  // a report without a frame
  EXPECT_THAT(history.Since(0), IsEmpty());
  EXPECT_EQ(history.newest_utc_ns(), 0);
  lost.times.exposure_utc_ns = kBegin;
  history.Add(lost);
  ASSERT_EQ(history.Since(0).size(), 1u);
  EXPECT_TRUE(std::isnan(history.Since(0)[0].total_n));
  history.Add(Pressed(kBegin + 1, 0));
  EXPECT_THAT(Totals(history), ElementsAre(0));
}

TEST(ForceHistoryTest, ForgetsTheOldest) {
  ForceHistory history;
  const auto bins = static_cast<int64_t>(ForceHistory::kBins);
  for (int64_t i = 0; i < bins + 10; ++i)
    history.Add(Pressed(kBegin + i * ForceHistory::kBinNs, static_cast<double>(i)));
  const std::vector<double> totals = Totals(history);
  ASSERT_EQ(totals.size(), ForceHistory::kBins);
  EXPECT_EQ(totals.front(), 10);
  EXPECT_EQ(totals.back(), static_cast<double>(bins + 9));
  EXPECT_THAT(Totals(history, kBegin + (bins + 8) * ForceHistory::kBinNs),
              ElementsAre(static_cast<double>(bins + 8), static_cast<double>(bins + 9)));
}

// The clock was set, or a log that is replayed begins again.
TEST(ForceHistoryTest, BeginsAnewWhereTimeGoesBack) {
  ForceHistory history;
  history.Add(Pressed(kBegin + 50 * ForceHistory::kBinNs, 1));
  history.Add(Pressed(kBegin, 2));
  EXPECT_THAT(Totals(history), ElementsAre(2));
}

}  // namespace
}  // namespace taclink::server

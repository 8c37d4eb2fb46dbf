#include "server/listener/connection_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

namespace taclink::server {
namespace {

using ::testing::HasSubstr;
using Id = ConnectionTable::Id;

constexpr int64_t kTableNowNs = 5'000'000'000, kTableSecondNs = 1'000'000'000;

std::string Remote(int host, int port) {
  return "ipv4:192.168.1." + std::to_string(host) + ":" + std::to_string(port);
}
std::string Local(int port) {
  return "ipv4:127.0.0.1:" + std::to_string(port);
}

class ConnectionTableTest : public ::testing::Test {
 protected:
  // Handed over at once.
  ConnectionTable::Admission Admit(const std::string& peer) {
    auto admission = table_.Admit(peer);
    EXPECT_TRUE(admission.ok()) << admission.error().message;
    const auto turn = table_.TakeTurn(admission->id, kTableNowNs);
    EXPECT_EQ(turn.wait_ns, 0);
    if (turn.gives_way) admission->gives_way = turn.gives_way;
    return *admission;
  }

  ConnectionTable table_{{.all = 16, .per_place = 4}};
};

TEST_F(ConnectionTableTest, OfAnAddressTheOldestThatHasShownNothingGivesWay) {
  const Id first = Admit(Remote(1, 1)).id;
  const Id second = Admit(Remote(1, 2)).id;
  table_.MarkAuthorized(Remote(1, 1));
  Admit(Remote(1, 3));
  EXPECT_EQ(Admit(Remote(1, 4)).gives_way, std::nullopt);
  EXPECT_EQ(Admit(Remote(1, 5)).gives_way, second);
  table_.Remove(second);
  table_.Remove(first);
  EXPECT_EQ(Admit(Remote(1, 6)).gives_way, std::nullopt) << "a place is free";
}

TEST_F(ConnectionTableTest, WhereAllAreAuthorizedTheNewOneIsRefusedAndOthersAreNot) {
  for (int port = 1; port <= 4; ++port) {
    Admit(Remote(1, port));
    table_.MarkAuthorized(Remote(1, port));
  }
  EXPECT_THAT(table_.Admit(Remote(1, 5)).error().message, HasSubstr("limits.max_connections_per_peer"));
  Admit(Remote(2, 1));
  Admit(Local(1));
}

TEST_F(ConnectionTableTest, OtherMachinesLeaveAQuarterToThisOne) {
  for (int host = 1; host <= 12; ++host) {
    Admit(Remote(host, 1));
    table_.MarkAuthorized(Remote(host, 1));
  }
  EXPECT_FALSE(table_.Admit(Remote(13, 1)).ok());
  for (int port = 1; port <= 4; ++port) Admit(Local(port));
}

TEST_F(ConnectionTableTest, FewConnectionsOfAllAddressesMayHaveShownNothing) {
  size_t gave_way = 0;
  for (int host = 1; host <= 12; ++host) gave_way += Admit(Remote(host, 1)).gives_way ? 1 : 0;
  EXPECT_EQ(gave_way, 4u) << "eight of all may be such";
}

// An operator who comes amid a flood of silent connections from the same address.
TEST_F(ConnectionTableTest, AFloodOfSilentConnectionsKeepsNobodyOut) {
  std::set<Id> ended;
  const auto flood = [&](int from, int count) {
    for (int port = from; port < from + count; ++port) {
      const auto admission = Admit(Local(port));
      if (!admission.gives_way) continue;
      ended.insert(*admission.gives_way);
      table_.Remove(*admission.gives_way);
    }
  };
  flood(1000, 100);
  const Id mine = Admit(Local(7)).id;
  flood(2000, 3);
  EXPECT_FALSE(ended.contains(mine));
  table_.MarkAuthorized(Local(7));
  flood(3000, 100);
  EXPECT_FALSE(ended.contains(mine));
  EXPECT_LE(table_.size(), 16u);
}

TEST_F(ConnectionTableTest, AnAddressThatMisbehavedIsSlowedDownForAWhileAndOthersAreNot) {
  const Id bad = Admit(Remote(1, 1)).id;
  table_.Punish(bad, kTableNowNs);
  table_.Remove(bad);
  int64_t wait_ns = 0;
  for (int port = 2; port <= 4; ++port)
    wait_ns = table_.TakeTurn(table_.Admit(Remote(1, port))->id, kTableNowNs).wait_ns;
  EXPECT_GT(wait_ns, 0);
  EXPECT_LT(wait_ns, kTableSecondNs / 4) << "its users still get in";
  Admit(Remote(2, 1));
  const auto later = table_.Admit(Remote(1, 5));
  for (int i = 0; i < 10; ++i)
    EXPECT_EQ(table_.TakeTurn(later->id, kTableNowNs + 20 * kTableSecondNs).wait_ns, 0);
}

// Forty that connect again as soon as they are ended, and an operator at the same address.
TEST(ConnectionTable, WhoWaitsIsNotEndedForThoseWhoComeLater) {
  ConnectionTable table({.all = 256, .per_place = 64});
  table.Punish(table.Admit(Local(1))->id, kTableNowNs);
  int64_t now_ns = kTableNowNs;
  std::set<Id> waiting, ended;
  const auto take_turns = [&] {
    for (const Id id : std::set<Id>(waiting)) {
      const auto turn = table.TakeTurn(id, now_ns);
      if (turn.gives_way) ended.insert(*turn.gives_way);
      if (turn.wait_ns == 0) waiting.erase(id);
    }
  };
  for (int port = 100; port < 140; ++port) waiting.insert(table.Admit(Local(port))->id);
  const Id mine = table.Admit(Local(7))->id;
  waiting.insert(mine);
  for (int port = 200; waiting.contains(mine); ++port) {
    now_ns += kTableSecondNs / 100;
    take_turns();
    ASSERT_LT(now_ns, kTableNowNs + kTableSecondNs) << "it is served within a second";
    if (const auto again = table.Admit(Local(port))) waiting.insert(again->id);
  }
  EXPECT_FALSE(ended.contains(mine));
}

// As the listener writes a peer, and as gRPC does.
TEST(ConnectionTable, AConnectionIsTheSameByBothNames) {
  ConnectionTable table({.all = 16, .per_place = 4});
  const Id six = table.Admit("ipv6:[2001:db8::1]:7").value().id;
  const Id neighbor = table.Admit("ipv6:[2001:db8::2]:7").value().id;
  const Id link_local = table.Admit("ipv6:[fe80::1]:7").value().id;
  const Id four = table.Admit("ipv4:10.0.0.1:7").value().id;
  EXPECT_EQ(table.MarkAuthorized("ipv6:%5B2001:db8::1%5D:7"), six);
  EXPECT_EQ(table.MarkAuthorized("ipv6:%5B2001:db8::1%5D:7"), std::nullopt) << "already";
  EXPECT_EQ(table.MarkAuthorized("ipv6:%5B2001:db8::2%5D:7"), neighbor);
  EXPECT_EQ(table.MarkAuthorized("ipv6:%5Bfe80::1%252%5D:7"), link_local);
  EXPECT_EQ(table.MarkAuthorized("ipv4:10.0.0.1:7"), four);
  EXPECT_EQ(table.MarkAuthorized("ipv4:10.0.0.1:8"), std::nullopt);
  EXPECT_EQ(table.Find("ipv4:10.0.0.1:7"), four) << "it is known as long as it lives";
  table.Remove(four);
  EXPECT_EQ(table.Find("ipv4:10.0.0.1:7"), std::nullopt);
}

TEST(ConnectionTable, ConnectionsOfAUnixSocketDoNotGiveWay) {
  ConnectionTable table({.all = 16, .per_place = 4});
  for (int i = 0; i < 12; ++i) EXPECT_EQ(table.Admit("unix:").value().gives_way, std::nullopt);
  EXPECT_FALSE(table.Admit("unix:").ok()) << "a quarter is not theirs";
}

TEST(ConnectionTable, ThoseThatWaitAreBounded) {
  ConnectionTable table({.all = 1000, .per_place = 500});
  const auto first = table.Admit(Remote(1, 1));
  table.Punish(first->id, kTableNowNs);
  int admitted = 0;
  std::string why;
  for (int port = 2; port < 400; ++port) {
    const auto admission = table.Admit(Remote(1, port));
    if (admission) ++admitted;
    if (admission)
      table.TakeTurn(admission->id, kTableNowNs);
    else
      why = admission.error().message;
  }
  EXPECT_LT(admitted, 70);
  EXPECT_THAT(why, HasSubstr("faster than they are taken"));
}

TEST(ConnectionTable, AddressesAreForgotten) {
  ConnectionTable table({.all = 100'000, .per_place = 1});
  for (int i = 0; i < 5000; ++i) {
    const auto admission =
        table.Admit("ipv4:10.0." + std::to_string(i / 250) + "." + std::to_string(i % 250) + ":1");
    ASSERT_TRUE(admission.ok());
    table.TakeTurn(admission->id, kTableNowNs + i * kTableSecondNs);
    table.Remove(admission->id);
  }
  EXPECT_LT(table.addresses(), 2000u);
}

}  // namespace
}  // namespace taclink::server

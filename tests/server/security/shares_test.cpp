#include "server/security/shares.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/security/party.h"

namespace taclink::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(Party, PlacesAreAddressesWithoutPorts) {
  const auto address = [](const char* peer) { return PlaceOf(peer).address; };
  EXPECT_EQ(address("ipv4:192.168.1.5:40000"), "ipv4:192.168.1.5");
  EXPECT_EQ(address("ipv6:%5B::1%5D:40000"), "ipv6:::1");
  EXPECT_EQ(address("ipv6:[::1]:40000"), "ipv6:::1") << "as the gateway writes it";
  EXPECT_EQ(address("ipv6:[::ffff:10.0.0.1]:40000"), "ipv4:10.0.0.1");
  EXPECT_EQ(address("ipv6:nonsense"), "ipv6:nonsense");
  EXPECT_EQ(address("ipv4:"), "ipv4:");
  EXPECT_EQ(address("unix:"), "unix");
  EXPECT_EQ(address("unix:/run/taclink"), "unix");
  EXPECT_EQ(address("inproc:1"), "");
  EXPECT_EQ(address(""), "");
}

TEST(Party, AHostWithANetworkOfIpv6AddressesIsOne) {
  const auto address = [](const char* peer) { return PlaceOf(peer).address; };
  EXPECT_EQ(address("ipv6:%5B2001:db8:1:2:3:4:5:6%5D:1"), "ipv6:2001:db8:1:2::/64");
  EXPECT_EQ(address("ipv6:%5B2001:db8:1:2:ffff::%5D:2"), "ipv6:2001:db8:1:2::/64");
  EXPECT_NE(address("ipv6:%5B2001:db8:1:3::1%5D:1"), "ipv6:2001:db8:1:2::/64");
  EXPECT_EQ(address("ipv6:%5Bfe80::1%25eth0%5D:1"), "ipv6:fe80::1") << "neighbors are many";
}

TEST(Party, WhatIsLocal) {
  for (const char* peer : {"ipv4:127.0.0.1:1", "ipv4:127.1.2.3:1", "ipv6:%5B::1%5D:1",
                           "ipv6:[::ffff:127.0.0.1]:1", "unix:", "inproc:1"})
    EXPECT_TRUE(PlaceOf(peer).local) << peer;
  for (const char* peer : {"ipv4:192.168.1.5:1", "ipv6:%5B2001:db8::1%5D:1", "ipv6:nonsense", "ipv6:[::2]:1"})
    EXPECT_FALSE(PlaceOf(peer).local) << peer;
}

TEST(Party, CountsByNameElseByAddressElseByConnection) {
  EXPECT_EQ(PartyOf("ipv4:10.0.0.1:1", "otto").who, PartyOf("ipv4:127.0.0.1:2", "otto").who);
  EXPECT_NE(PartyOf("ipv4:10.0.0.1:1", "otto").who, PartyOf("ipv4:10.0.0.1:1", "anna").who);
  EXPECT_EQ(PartyOf("ipv4:10.0.0.1:1", "").who, PartyOf("ipv4:10.0.0.1:2", "").who);
  EXPECT_NE(PartyOf("ipv4:127.0.0.1:1", "").who, PartyOf("ipv4:127.0.0.1:2", "").who);
  EXPECT_TRUE(PartyOf("ipv4:10.0.0.1:1", "otto").preferred);
  EXPECT_TRUE(PartyOf("ipv4:127.0.0.1:1", "").preferred);
  EXPECT_FALSE(PartyOf("ipv4:10.0.0.1:1", "").preferred);
}

// All connections of a unix socket are called "unix:".
TEST(Party, OfAUnixSocketNoProgramCountsForAnother) {
  EXPECT_EQ(PartyOf("unix:", "").who, "");
  EXPECT_TRUE(PartyOf("unix:", "").preferred);
  EXPECT_EQ(PartyOf("unix:", "otto").who, PartyOf("ipv4:10.0.0.1:1", "otto").who);
}

constexpr ShareWords kWords = {
    .things = "streams", .all_setting = "limits.max", .party_setting = "limits.own"};

TEST(Shares, OnePartyTakesNoMoreThanItsOwn) {
  Shares shares({.all = 8, .per_party = 2}, kWords);
  const Party greedy{.who = "clients at greedy"}, other{.who = "clients at other"};
  EXPECT_TRUE(shares.Take(greedy).ok());
  EXPECT_TRUE(shares.Take(greedy).ok());
  for (int i = 0; i < 100; ++i)
    EXPECT_THAT(shares.Take(greedy).error().message,
                AllOf(HasSubstr("all 2 streams of clients at greedy"), HasSubstr("raise limits.own")));
  EXPECT_TRUE(shares.Take(other).ok());
  shares.Give(greedy);
  EXPECT_TRUE(shares.Take(greedy).ok());
}

TEST(Shares, APartIsKeptForThePreferred) {
  Shares shares({.all = 8, .per_party = 2}, kWords);
  const auto stranger = [](int number) { return Party{.who = "clients at " + std::to_string(number)}; };
  for (int i = 0; i < 6; ++i) EXPECT_TRUE(shares.Take(stranger(i)).ok());
  EXPECT_THAT(shares.Take(stranger(6)).error().message,
              AllOf(HasSubstr("the last 2 streams are kept"), HasSubstr("limits.max")));
  const Party local{.who = "the connection a", .preferred = true},
      known{.who = "caller b", .preferred = true};
  EXPECT_TRUE(shares.Take(local).ok());
  EXPECT_TRUE(shares.Take(known).ok());
  EXPECT_THAT(shares.Take({.who = "caller c", .preferred = true}).error().message,
              HasSubstr("all 8 streams are in use"));
  shares.Give(local);
  EXPECT_FALSE(shares.Take(stranger(6)).ok());
  shares.Give(stranger(0));
  EXPECT_TRUE(shares.Take(stranger(6)).ok());
}

TEST(Shares, ThePreferredMayTakeMoreThanWhatIsKept) {
  Shares shares({.all = 8, .per_party = 1}, kWords);
  for (int i = 0; i < 7; ++i)
    EXPECT_TRUE(shares.Take({.who = "caller " + std::to_string(i), .preferred = true}).ok());
  EXPECT_TRUE(shares.Take({.who = "clients at x"}).ok()) << "what is free";
}

TEST(Shares, WithinTheProcessNoPartyIsCounted) {
  Shares shares({.all = 3, .per_party = 1}, kWords);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(shares.Take(PartyOf("inproc:1", "")).ok());
  EXPECT_FALSE(shares.Take(PartyOf("inproc:1", "")).ok());
}

}  // namespace
}  // namespace taclink::server

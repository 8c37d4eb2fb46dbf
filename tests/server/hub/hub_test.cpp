#include "server/hub/hub.h"

#include <gtest/gtest.h>

#include <atomic>
#include <random>
#include <thread>

#include "tests/server/support.h"

namespace taclink::server {
namespace {

std::string Encode(size_t link, const LinkState& state, Detail detail) {
  return std::to_string(link) + ":" + std::to_string(state.sequence) + ":" + std::to_string(Index(detail));
}

std::vector<uint64_t> TakeAll(Subscription& subscription) {
  std::vector<uint64_t> sequences;
  while (const auto publication = subscription.Take()) sequences.push_back(publication->state().sequence);
  return sequences;
}

TEST(Hub, LatestKeepsTheNewestOfEachLink) {
  Hub hub(2, Encode);
  const auto subscription = hub.Subscribe({.delivery = Delivery::kLatest}, [] {});
  for (uint64_t i = 1; i <= 5; ++i) {
    hub.Publish(0, MakeState(i));
    hub.Publish(1, MakeState(10 * i));
  }
  EXPECT_EQ(subscription->waiting(), 2u);
  EXPECT_EQ(TakeAll(*subscription), (std::vector<uint64_t>{5, 50}));
  const auto counts = subscription->Counts();
  EXPECT_EQ(counts[0].taken, 1u);
  EXPECT_EQ(counts[0].dropped, 4u);
  EXPECT_EQ(counts[1].dropped, 4u);
  EXPECT_EQ(subscription->dropped(), 8u);
}

TEST(Hub, LatestBeginsWithWhatIsThere) {
  Hub hub(2, Encode);
  hub.Publish(1, MakeState(7));
  const auto latest = hub.Subscribe({.delivery = Delivery::kLatest}, [] {});
  const auto every = hub.Subscribe({.delivery = Delivery::kEvery}, [] {});
  EXPECT_EQ(TakeAll(*latest), (std::vector<uint64_t>{7}));
  EXPECT_TRUE(TakeAll(*every).empty());
  EXPECT_EQ(hub.Latest(0), nullptr);
  EXPECT_EQ(hub.Latest(1)->state().sequence, 7u);
}

TEST(Hub, EveryKeepsOrderAndDropsTheOldest) {
  Hub hub(1, Encode);
  const auto subscription = hub.Subscribe({.delivery = Delivery::kEvery, .queue_capacity = 4}, [] {});
  for (uint64_t i = 1; i <= 3; ++i) hub.Publish(0, MakeState(i));
  EXPECT_EQ(TakeAll(*subscription), (std::vector<uint64_t>{1, 2, 3}));
  for (uint64_t i = 4; i <= 13; ++i) hub.Publish(0, MakeState(i));
  EXPECT_EQ(TakeAll(*subscription), (std::vector<uint64_t>{10, 11, 12, 13}));
  EXPECT_EQ(subscription->Counts()[0].taken, 7u);
  EXPECT_EQ(subscription->Counts()[0].dropped, 6u);
}

TEST(Hub, OnlyWantedLinksArrive) {
  Hub hub(3, Encode);
  const auto subscription =
      hub.Subscribe({.links = {false, true, false}, .delivery = Delivery::kEvery}, [] {});
  for (size_t link = 0; link < 3; ++link) hub.Publish(link, MakeState(link));
  EXPECT_EQ(TakeAll(*subscription), (std::vector<uint64_t>{1}));
  EXPECT_EQ(subscription->dropped(), 0u);
}

TEST(Hub, StoppedSubscribersHoldABoundedNumberOfStates) {
  std::atomic<int> alive = 0;  // outlives the hub, which holds the newest
  Hub hub(2, Encode);
  const auto every = hub.Subscribe({.delivery = Delivery::kEvery, .queue_capacity = 16}, [] {});
  const auto other = hub.Subscribe({.delivery = Delivery::kEvery, .queue_capacity = 16}, [] {});
  const auto latest = hub.Subscribe({.delivery = Delivery::kLatest}, [] {});
  int most_alive = 0;
  for (uint64_t i = 0; i < 5000; ++i) {
    ++alive;
    hub.Publish(i % 2, {new LinkState, [&](const LinkState* state) {
                          --alive;
                          delete state;
                        }});
    most_alive = std::max(most_alive, alive.load());
  }
  EXPECT_LE(most_alive, 16 + 2 + 1);  // those who stopped hold the same newest ones
  EXPECT_EQ(every->dropped(), 5000u - 16);
  EXPECT_EQ(latest->dropped(), 5000u - 2);
}

// States of `markers` markers that are encoded to `encoded_bytes`.
size_t MostWaitingBytes(size_t markers, size_t encoded_bytes, size_t queue_bytes, Subscription& reader,
                        Hub& hub) {
  size_t most = 0;
  for (uint64_t i = 1; i <= 100; ++i) {
    auto state = std::make_shared<LinkState>();
    state->sequence = i;
    state->shape.positions_mm.resize(markers);
    hub.Publish(0, state);
    const auto taken = reader.Take();
    EXPECT_EQ(taken->Encoded(Detail::kFull)->size(), encoded_bytes);
    most = std::max(most, reader.waiting_bytes());
    EXPECT_LE(most, queue_bytes);
  }
  return most;
}

TEST(Hub, EveryIsBoundedInBytesToo) {
  constexpr size_t kMarkers = 1000, kEncoded = 10'000, kBytes = 400'000;
  Hub hub(1, [](size_t, const LinkState&, Detail) { return std::string(kEncoded, 'x'); });
  const SubscriberOptions options{
      .delivery = Delivery::kEvery, .queue_capacity = 64, .queue_bytes = kBytes, .detail = Detail::kFull};
  const auto stopped = hub.Subscribe(options, [] {}), reader = hub.Subscribe(options, [] {});
  MostWaitingBytes(kMarkers, kEncoded, kBytes, *reader, hub);
  const size_t each = sizeof(LinkState) + kMarkers * sizeof(Vec3) + kEncoded;
  EXPECT_LE(stopped->waiting_bytes(), kBytes);
  EXPECT_NEAR(static_cast<double>(stopped->waiting()), static_cast<double>(kBytes / each), 1);
  const auto counts = stopped->Counts();
  EXPECT_EQ(counts[0].dropped + stopped->waiting(), 100u);
  EXPECT_EQ(counts[0].dropped_for_bytes, counts[0].dropped);
  EXPECT_EQ(reader->dropped(), 0u);
  const size_t waiting = stopped->waiting();
  EXPECT_EQ(TakeAll(*stopped).size(), waiting);
  EXPECT_EQ(stopped->waiting_bytes(), 0u);
}

TEST(Hub, SubscribersOfOnePartyShareItsBytes) {
  constexpr size_t kMarkers = 1000, kBytes = 400'000;
  Hub hub(1, Encode);
  const auto bytes = std::make_shared<ByteBudget>(kBytes);
  const SubscriberOptions party{
      .delivery = Delivery::kEvery, .queue_capacity = 64, .queue_bytes = kBytes, .party_bytes = bytes};
  SubscriberOptions other = party;
  other.party_bytes.reset();
  auto a = hub.Subscribe(party, [] {}), b = hub.Subscribe(party, [] {}), c = hub.Subscribe(other, [] {});
  auto publish = [&hub, sequence = uint64_t{0}](int count) mutable {
    for (int i = 0; i < count; ++i) {
      auto state = std::make_shared<LinkState>();
      state->sequence = ++sequence;
      state->shape.positions_mm.resize(kMarkers);
      hub.Publish(0, state);
    }
  };
  publish(100);
  const size_t each = sizeof(LinkState) + kMarkers * sizeof(Vec3);
  EXPECT_EQ(bytes->used(), a->waiting_bytes() + b->waiting_bytes());
  EXPECT_LE(bytes->used(), kBytes + 2 * each);
  EXPECT_GT(c->waiting_bytes(), kBytes / 2) << "another party has its own";
  EXPECT_GE(a->waiting(), 1u);
  EXPECT_GE(b->waiting(), 1u) << "the newest always waits";
  EXPECT_EQ(a->Counts()[0].dropped_for_bytes, a->Counts()[0].dropped);
  EXPECT_EQ(a->Counts()[0].dropped + a->waiting(), 100u);
  a.reset();
  publish(100);
  EXPECT_EQ(bytes->used(), b->waiting_bytes());
  EXPECT_GT(b->waiting_bytes(), kBytes / 2) << "what one held is free for the other";
  TakeAll(*b);
  EXPECT_EQ(bytes->used(), 0u);
}

TEST(Hub, TheNewestStateWaitsHoweverLargeItIs) {
  Hub hub(1, Encode);
  const auto subscription = hub.Subscribe({.delivery = Delivery::kEvery, .queue_bytes = 1}, [] {});
  for (uint64_t i = 1; i <= 3; ++i) hub.Publish(0, MakeState(i));
  EXPECT_EQ(TakeAll(*subscription), (std::vector<uint64_t>{3}));
  EXPECT_EQ(subscription->Counts()[0].dropped_for_bytes, 2u);
}

TEST(Hub, WhatNobodyTakesIsNotEncoded) {
  std::atomic<int> encoded = 0;
  Hub hub(1, [&](size_t, const LinkState&, Detail) { return ++encoded, std::string(); });
  for (uint64_t i = 1; i <= 10; ++i) hub.Publish(0, MakeState(i));
  const auto latest = hub.Subscribe({}, [] {});
  const auto every = hub.Subscribe({.delivery = Delivery::kEvery, .queue_capacity = 2}, [] {});
  for (uint64_t i = 11; i <= 20; ++i) hub.Publish(0, MakeState(i));
  EXPECT_EQ(encoded, 0);
  while (const auto publication = latest->Take()) publication->Encoded(Detail::kGeometry);
  EXPECT_EQ(encoded, 1) << "the newest; the others were dropped";
  while (const auto publication = every->Take()) publication->Encoded(Detail::kGeometry);
  EXPECT_EQ(encoded, 2) << "two wait, one of them is encoded already";
}

TEST(Hub, EncodesOnceForAllAndOnlyWhatIsAsked) {
  std::array<std::atomic<int>, kDetailCount> encoded{};
  Hub hub(1, [&](size_t link, const LinkState& state, Detail detail) {
    ++encoded[Index(detail)];
    return Encode(link, state, detail);
  });
  const auto a = hub.Subscribe({}, [] {});
  const auto b = hub.Subscribe({}, [] {});
  hub.Publish(0, MakeState(3));
  EXPECT_EQ(encoded[Index(Detail::kFull)], 0);
  const auto from_a = a->Take()->Encoded(Detail::kFull);
  const auto from_b = b->Take()->Encoded(Detail::kFull);
  EXPECT_EQ(from_a, from_b);
  EXPECT_EQ(*from_a, "0:3:2");
  EXPECT_EQ(encoded[Index(Detail::kFull)], 1);
  EXPECT_EQ(encoded[Index(Detail::kContacts)], 0);
}

// Publishes 10 s at 30/s with some jitter and returns how many were taken at `max_rate_hz`.
size_t TakenAtRate(double max_rate_hz, Delivery delivery) {
  Hub hub(1, Encode);
  const auto subscription = hub.Subscribe({.delivery = delivery, .max_rate_hz = max_rate_hz}, [] {});
  std::mt19937 random(1);
  std::uniform_int_distribution<int64_t> jitter_ns(-3'000'000, 3'000'000);
  size_t taken = 0;
  for (uint64_t i = 0; i < 300; ++i) {
    hub.Publish(0, MakeState(i, 1'000'000'000 + static_cast<int64_t>(i) * 33'333'333 + jitter_ns(random)));
    taken += TakeAll(*subscription).size();
  }
  EXPECT_EQ(subscription->dropped(), 0u);
  return taken;
}

TEST(Hub, RateLimitHoldsInTheLongRun) {
  for (const auto delivery : {Delivery::kLatest, Delivery::kEvery}) {
    EXPECT_EQ(TakenAtRate(0, delivery), 300u);
    EXPECT_EQ(TakenAtRate(30, delivery), 300u);
    EXPECT_NEAR(static_cast<double>(TakenAtRate(10, delivery)), 100, 2);
    EXPECT_NEAR(static_cast<double>(TakenAtRate(20, delivery)), 200, 4);
    EXPECT_EQ(TakenAtRate(0.1, delivery), 1u);
  }
}

TEST(Hub, PicturesAreKeptOnlyForThoseWhoWantThem) {
  Hub hub(2, Encode);
  const auto without = hub.Subscribe({.delivery = Delivery::kEvery}, [] {});
  EXPECT_FALSE(hub.WantsPictures(0));
  auto with = hub.Subscribe(
      {.links = {true, false}, .delivery = Delivery::kEvery, .queue_bytes = 250'000, .pictures = true},
      [] {});
  EXPECT_TRUE(hub.WantsPictures(0));
  EXPECT_FALSE(hub.WantsPictures(1));
  std::vector<std::weak_ptr<const FramePictures>> published;
  for (uint64_t i = 1; i <= 3; ++i) {
    auto pictures = std::make_shared<FramePictures>();
    pictures->raw[0].bytes.assign(100'000, static_cast<uint8_t>(i));
    published.push_back(pictures);
    hub.Publish(0, MakeState(i), pictures);
  }
  EXPECT_EQ(with->Counts()[0].dropped_for_bytes, 1u);
  EXPECT_TRUE(published[0].expired());
  PicturesPtr pictures;
  for (const uint64_t i : {2u, 3u}) {
    EXPECT_EQ(with->Take(nullptr, &pictures)->state().sequence, i);
    EXPECT_EQ(pictures->raw[0].bytes[0], i);
  }
  pictures.reset();
  EXPECT_TRUE(published[2].expired()) << "the other one's queue holds pictures";
  EXPECT_EQ(TakeAll(*without), (std::vector<uint64_t>{1, 2, 3}));
  with.reset();
  hub.Publish(0, MakeState(4));
  EXPECT_FALSE(hub.WantsPictures(0));
}

TEST(Hub, NotifiesOnceForEachTimeThatNothingWasThere) {
  Hub hub(1, Encode);
  int notified = 0;
  const auto subscription = hub.Subscribe({.delivery = Delivery::kEvery}, [&] { ++notified; });
  EXPECT_EQ(subscription->Take(), nullptr);
  hub.Publish(0, MakeState(1));
  hub.Publish(0, MakeState(2));
  EXPECT_EQ(notified, 1);
  EXPECT_EQ(TakeAll(*subscription).size(), 2u);
  hub.Publish(0, MakeState(3));
  EXPECT_EQ(notified, 2);
}

TEST(Hub, NotificationMayUseTheHub) {
  Hub hub(1, Encode);
  std::vector<uint64_t> taken;
  Subscription* subscription = nullptr;
  const auto owner = hub.Subscribe({.delivery = Delivery::kEvery}, [&] { taken = TakeAll(*subscription); });
  subscription = owner.get();
  EXPECT_EQ(owner->Take(), nullptr);
  hub.Publish(0, MakeState(9));
  EXPECT_EQ(taken, (std::vector<uint64_t>{9}));
}

TEST(Hub, ManyThreadsLoseNothingUncounted) {
  constexpr uint64_t kEach = 3000;
  constexpr size_t kLinks = 3;
  Hub hub(kLinks, Encode);
  Receiver fast(hub, {.delivery = Delivery::kEvery, .queue_capacity = 64});
  Receiver newest(hub, {.delivery = Delivery::kLatest});
  const auto stopped = hub.Subscribe({.delivery = Delivery::kEvery, .queue_capacity = 8}, [] {});
  std::atomic<size_t> publishing = kLinks;
  const auto read = [&](Receiver& receiver) {
    std::vector<uint64_t> last(kLinks, 0);
    while (true) {
      const bool was_publishing = publishing > 0;
      const auto publication = receiver.Next(std::chrono::milliseconds(10));
      if (!publication && !was_publishing) return;
      if (!publication) continue;
      ASSERT_GT(publication->state().sequence, last[publication->link()]);
      last[publication->link()] = publication->state().sequence;
      EXPECT_FALSE(publication->Encoded(Detail::kContacts)->empty());
    }
  };
  std::vector<std::jthread> threads;
  for (size_t link = 0; link < kLinks; ++link) {
    threads.emplace_back([&, link] {
      for (uint64_t i = 1; i <= kEach; ++i) hub.Publish(link, MakeState(i));
      --publishing;
    });
  }
  threads.emplace_back([&] { read(fast); });
  threads.emplace_back([&] { read(newest); });
  threads.emplace_back([&] {  // comes and goes
    for (int i = 0; i < 200; ++i) hub.Subscribe({}, [] {})->Take();
  });
  threads.clear();
  for (Subscription* subscription : {&fast.subscription(), &newest.subscription(), stopped.get()}) {
    uint64_t total = subscription->waiting();
    for (const auto& counts : subscription->Counts()) total += counts.taken + counts.dropped;
    EXPECT_EQ(total, kEach * kLinks);
  }
  EXPECT_EQ(stopped->waiting(), 8u);
}

}  // namespace
}  // namespace taclink::server

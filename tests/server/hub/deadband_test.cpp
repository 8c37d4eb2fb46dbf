#include "server/hub/deadband.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/server/support.h"
#include "tests/support/times.h"

namespace taclink::server {
namespace {

// One contact of `force_n`, none if 0, and three markers at x = `x_mm`.
LinkState Touched(double force_n, double x_mm = 0, LinkStatus status = LinkStatus::kOk) {
  LinkState state;
  state.status = status;
  state.shape.positions_mm.assign(3, Vec3(x_mm, 0, 0));
  if (force_n != 0) {
    Contact contact;
    contact.id = 4;
    contact.force_n = Vec3(0, force_n, 0);
    state.contacts.push_back(contact);
  }
  return state;
}

TEST(Deadband, ForcesAndMarkersCountWhereTheirLimitIsSet) {
  const Deadband force{.force_n = 0.1}, move{.move_mm = 0.05}, both{.force_n = 0.1, .move_mm = 0.05};
  const LinkState before = Touched(1);
  EXPECT_TRUE(Within(force, before, Touched(1.09, 9)));
  EXPECT_FALSE(Within(force, before, Touched(1.11)));
  EXPECT_FALSE(Within(force, before, Touched(0.89)));
  EXPECT_TRUE(Within(move, before, Touched(7, 0.04)));
  EXPECT_FALSE(Within(move, before, Touched(1, 0.06)));
  EXPECT_TRUE(Within(both, before, Touched(1.05, 0.04)));
  EXPECT_FALSE(Within(both, before, Touched(1.05, 0.06)));
  EXPECT_FALSE(Within(both, before, Touched(1.2, 0.04)));
  EXPECT_FALSE(Within({}, before, before)) << "no deadband: all is news";
}

TEST(Deadband, AContactThatComesOrGoesChangesByItsForce) {
  const Deadband deadband{.force_n = 0.1};
  EXPECT_TRUE(Within(deadband, Touched(0), Touched(0.05)));
  EXPECT_FALSE(Within(deadband, Touched(0), Touched(0.2)));
  EXPECT_TRUE(Within(deadband, Touched(0.05), Touched(0)));
  EXPECT_FALSE(Within(deadband, Touched(0.2), Touched(0)));
  LinkState other = Touched(0.2);
  other.contacts[0].id = 5;
  EXPECT_FALSE(Within(deadband, Touched(0.2), other)) << "another contact of the same force";
}

TEST(Deadband, ARingContactCountsByItsNormalForce) {
  const Deadband deadband{.force_n = 0.1};
  const auto ring = [](double normal_force_n) {
    LinkState state = Touched(1e-3);
    state.contacts[0].normal_force_n = normal_force_n;
    return state;
  };
  EXPECT_TRUE(Within(deadband, ring(1), ring(1.09)));
  EXPECT_FALSE(Within(deadband, ring(1), ring(1.11)));
  EXPECT_FALSE(Within(deadband, Touched(0), ring(0.2)));
  EXPECT_FALSE(Within(deadband, ring(0.2), Touched(0)));
}

TEST(Deadband, AnotherStatusIsNews) {
  const Deadband deadband{.force_n = 10, .move_mm = 10};
  EXPECT_FALSE(Within(deadband, Touched(1), Touched(1, 0, LinkStatus::kDegraded)));
  EXPECT_FALSE(Within(deadband, Touched(1), LinkState{}));
  LinkState unmeasured = Touched(1);
  unmeasured.shape.positions_mm.clear();
  EXPECT_FALSE(Within(deadband, Touched(1), unmeasured));
}

TEST(Deadband, ForcesThatAreNoLongerKnownAreNews) {
  const Deadband deadband{.force_n = 10, .move_mm = 10};
  const LinkState known = Touched(0, 0, LinkStatus::kDegraded);
  LinkState unknown = known;
  unknown.forces.converged = false;
  EXPECT_TRUE(Within(deadband, known, known));
  EXPECT_FALSE(Within(deadband, known, unknown));
  EXPECT_FALSE(Within(deadband, unknown, known));
}

TEST(Deadband, NumbersThatAreNoneAreNews) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Within({.force_n = 1}, Touched(nan), Touched(nan)));
  EXPECT_FALSE(Within({.move_mm = 1}, Touched(1, nan), Touched(1, nan)));
}

struct Taken {
  uint64_t sequence;
  bool unchanged;
  bool operator==(const Taken&) const = default;
};
std::ostream& operator<<(std::ostream& out, const Taken& taken) {
  return out << taken.sequence << (taken.unchanged ? " unchanged" : "");
}

class DeadbandQueue : public ::testing::Test {
 protected:
  void Subscribe(Delivery delivery, size_t capacity = 256) {
    subscription_ = hub_.Subscribe(
        {.delivery = delivery, .queue_capacity = capacity, .deadband = {.force_n = 0.1}}, [] {});
  }
  // At 10 frames a second.
  void Publish(double force_n) {
    auto state = std::make_shared<LinkState>(Touched(force_n));
    state->sequence = ++sequence_;
    state->times.published_ns = static_cast<int64_t>(sequence_) * 100 * kMs;
    hub_.Publish(0, state);
  }
  std::vector<Taken> TakeAll() {
    std::vector<Taken> taken;
    bool unchanged = false;
    while (const auto publication = subscription_->Take(&unchanged))
      taken.push_back({publication->state().sequence, unchanged});
    return taken;
  }

  Hub hub_{1, [](size_t, const LinkState&, Detail) { return std::string(); }};
  std::unique_ptr<Subscription> subscription_;
  uint64_t sequence_ = 0;
};

TEST_F(DeadbandQueue, AQuietLinkIsSentOnceASecond) {
  Subscribe(Delivery::kEvery);
  for (int i = 0; i < 25; ++i) Publish(1);
  EXPECT_EQ(TakeAll(), (std::vector<Taken>{{1, false}, {11, true}, {21, true}}));
  const auto counts = subscription_->Counts();
  EXPECT_EQ(counts[0].taken, 3u);
  EXPECT_EQ(counts[0].unchanged, 22u);
  EXPECT_EQ(counts[0].dropped, 0u);
  Publish(1.5);  // at once
  EXPECT_EQ(TakeAll(), (std::vector<Taken>{{26, false}}));
}

TEST_F(DeadbandQueue, SlowDriftAddsUp) {
  Subscribe(Delivery::kEvery);
  for (int i = 0; i < 9; ++i) Publish(1 + 0.03 * i);
  EXPECT_EQ(TakeAll(), (std::vector<Taken>{{1, false}, {5, false}, {9, false}}));
}

// What changed was never seen by the client, so what replaces it must not be called unchanged.
TEST_F(DeadbandQueue, ADroppedChangeIsNotForgotten) {
  for (const auto delivery : {Delivery::kLatest, Delivery::kEvery}) {
    hub_.Publish(0, std::make_shared<LinkState>(Touched(1)));
    Subscribe(delivery, 1);
    sequence_ = 0;
    Publish(1);
    TakeAll();
    Publish(2);                                  // waits
    for (int i = 0; i < 10; ++i) Publish(2.04);  // the last of them pushes it out
    EXPECT_EQ(TakeAll(), (std::vector<Taken>{{12, false}}));
    Publish(1.95);  // within the deadband about 2, but not about 2.04... which is what the client has
    Publish(1.93);
    EXPECT_EQ(TakeAll(), (std::vector<Taken>{{14, false}}));
  }
}

}  // namespace
}  // namespace taclink::server

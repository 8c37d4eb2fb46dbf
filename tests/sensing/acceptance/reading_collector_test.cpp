#include "sensing/acceptance/reading_collector.h"

#include <gtest/gtest.h>

namespace taclink {
namespace {

LinkState StateAt(double time_s, std::vector<Contact> contacts) {
  LinkState state;
  state.status = LinkStatus::kOk;
  state.times.exposure_monotonic_ns = static_cast<int64_t>(1e9 * time_s);
  state.times.exposure_utc_ns = state.times.exposure_monotonic_ns + 7;
  for (const Contact& contact : contacts) state.total_force_n += contact.force_n;
  state.contacts = std::move(contacts);
  return state;
}

Contact ContactAt(const Vec3& center_mm, double force_n) {
  Contact contact;
  contact.center_mm = center_mm;
  contact.normal = Vec3::UnitX();
  contact.force_n = -force_n * Vec3::UnitX();
  contact.normal_force_n = force_n;
  contact.force_covariance_n2 = Mat3(0.01 * Mat3::Identity());
  return contact;
}

const Vec3 kPlace(40, 0, 90);

TEST(ReadingCollector, ContactsNearThePlaceAreTheLoadAndOthersAreNot) {
  ReadingCollector collector(kPlace);
  for (int i = 0; i < 4; ++i) {
    collector.Add(StateAt(0.1 * i, {ContactAt({38, 0, 80}, 0.3), ContactAt({38, 0, 100}, i % 2 ? 0.2 : 0.1),
                                    ContactAt({-40, 0, 90}, 0.9)}));
  }
  const TrialReading reading = collector.Reading();
  EXPECT_EQ(reading.frames, 4);
  EXPECT_EQ(reading.usable, 4);
  EXPECT_TRUE(reading.has_contact);
  EXPECT_NEAR(reading.force_n, 0.45, 1e-12);
  EXPECT_NEAR(reading.force_sd_n, 0.0577, 1e-3);
  EXPECT_NEAR(reading.others_n, 0.9, 1e-12);
  EXPECT_NEAR(reading.center_mm.z(), (0.3 * 80 + 0.15 * 100) / 0.45, 1e-9);
  EXPECT_NEAR(reading.stated_sigma_n.value(), 0.1414, 1e-3);
  EXPECT_NEAR(reading.total_force_n.x(), -1.35, 1e-12);
  EXPECT_NEAR(reading.duration_s, 0.3, 1e-9);
  EXPECT_EQ(reading.utc_ns, 7);
}

TEST(ReadingCollector, FramesWithoutForcesDoNotCountAndSayWhy) {
  ReadingCollector collector(kPlace);
  LinkState blind = StateAt(0, {});
  blind.status = LinkStatus::kLost;
  blind.reasons = {{ReasonId::kFewMarkers, "too few markers"}};
  collector.Add(blind);
  collector.Add(blind);
  collector.Add(StateAt(0.2, {ContactAt(kPlace, 0.5)}));
  const TrialReading reading = collector.Reading();
  EXPECT_EQ(reading.frames, 3);
  EXPECT_EQ(reading.usable, 1);
  EXPECT_NEAR(reading.force_n, 0.5, 1e-12);
  ASSERT_EQ(reading.reasons.size(), 1u);
  EXPECT_EQ(reading.reasons[0].frames, 2);
  EXPECT_EQ(reading.reasons[0].text, "too few markers");
}

TEST(ReadingCollector, RareContactsAreGhosts) {
  ReadingCollector collector(kPlace);
  for (int i = 0; i < 10; ++i)
    collector.Add(StateAt(0.1 * i, i == 3 ? std::vector{ContactAt(kPlace, 0.5)} : std::vector<Contact>{}));
  EXPECT_FALSE(collector.Reading().has_contact);
  EXPECT_EQ(collector.Reading().force_n, 0);
  EXPECT_NEAR(collector.Reading().others_n, 0.05, 1e-12);
}

// What is felt in some frames only is felt as less: the mean is over all that have forces.
TEST(ReadingCollector, AFlickeringContactIsLessThanASteadyOne) {
  ReadingCollector collector(kPlace);
  for (int i = 0; i < 10; ++i)
    collector.Add(StateAt(0.1 * i, i % 5 < 3 ? std::vector{ContactAt(kPlace, 0.5)} : std::vector<Contact>{}));
  EXPECT_TRUE(collector.Reading().has_contact);
  EXPECT_NEAR(collector.Reading().force_n, 0.3, 1e-12);
  EXPECT_NEAR(collector.Reading().center_mm.x(), kPlace.x(), 1e-9);
}

TEST(ReadingCollector, HeldForceIsSampledOnceASecond) {
  ReadingCollector collector(kPlace, 30, true);
  for (int i = 0; i < 50; ++i) collector.Add(StateAt(0.1 * i, {ContactAt(kPlace, 1 + 0.01 * i)}));
  const auto& held = collector.Reading().held;
  ASSERT_EQ(held.size(), 5u);
  for (size_t i = 0; i < held.size(); ++i) {
    EXPECT_NEAR(held[i].time_s, static_cast<double>(i) + 0.45, 1e-9);
    EXPECT_NEAR(held[i].force_n, 1.045 + 0.1 * static_cast<double>(i), 1e-9);
  }
}

TEST(ReadingCollector, NothingAddedIsNoReading) {
  const TrialReading reading = ReadingCollector(std::nullopt).Reading();
  EXPECT_EQ(reading.frames, 0);
  EXPECT_FALSE(reading.has_contact);
  EXPECT_FALSE(reading.pressure_mpa);
}

}  // namespace
}  // namespace taclink

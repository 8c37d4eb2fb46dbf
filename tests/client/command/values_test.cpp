#include "client/cpp/taclink/values.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink::client {
namespace {

using ::testing::ElementsAre;

TEST(Values, EnumNamesAreThoseOfTheProto) {
  EXPECT_STREQ(Name(v1::EVENT_KIND_FORCE_LEVEL), "force_level");
  EXPECT_STREQ(Name(v1::LINK_STATUS_UNSPECIFIED), "unknown");
  EXPECT_STREQ(Name(static_cast<v1::LinkStatus>(99)), "unknown") << "of a newer version";
  EXPECT_EQ(ValueOf<v1::BaselineOrigin>("forced_tare"), v1::BASELINE_ORIGIN_FORCED_TARE);
  EXPECT_EQ(ValueOf<v1::BaselineOrigin>("unknown"), std::nullopt);
  EXPECT_THAT(Names<v1::Detail>(), ElementsAre("contacts", "geometry", "full"));
}

TEST(Values, ArraysAreGroupedByThree) {
  v1::LinkFrame frame;
  for (const float number : {1.f, 2.f, 3.f, 4.f, 5.f, 6.f, 7.f}) frame.add_positions_m(number);
  EXPECT_THAT(Points(frame.positions_m()), ElementsAre(Vector3{1, 2, 3}, Vector3{4, 5, 6}));
}

TEST(Values, AnEmptyCovarianceIsNotKnown) {
  v1::Contact contact;
  EXPECT_EQ(Covariance(contact.force_covariance_n2()), std::nullopt);
  for (const double number : {4., 1., 1., 9., 1., 16.}) contact.add_force_covariance_n2(number);
  const auto covariance = Covariance(contact.force_covariance_n2());
  ASSERT_TRUE(covariance.has_value());
  EXPECT_EQ(Sigmas(*covariance), (Vector3{2, 3, 4}));
}

TEST(Values, LatencyNeedsAnExposureAndALiveServer) {
  v1::LinkFrame frame;
  EXPECT_EQ(LatencyS(frame), std::nullopt);
  frame.mutable_times()->set_exposure_utc_ns(1);
  EXPECT_GT(LatencyS(frame).value(), 0);
  frame.set_replayed(true);
  EXPECT_EQ(LatencyS(frame), std::nullopt);

  v1::Event event;
  event.mutable_times()->set_exposure_utc_ns(1);
  EXPECT_EQ(LatencyS(event), std::nullopt) << "from a log: never sent";
  event.mutable_times()->set_sent_utc_ns(2);
  EXPECT_GT(LatencyS(event).value(), 0);
}

}  // namespace
}  // namespace taclink::client

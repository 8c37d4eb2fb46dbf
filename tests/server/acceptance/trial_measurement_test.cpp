#include "server/acceptance/trial_measurement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <string>

#include "tests/server/support.h"

namespace taclink::server {
namespace {

using testing::HasSubstr;

class TrialMeasurementTest : public testing::Test {
 protected:
  ~TrialMeasurementTest() override { pool_.join(); }

  std::future<Result<TrialReading>> Start(const MeasurementOptions& options,
                                          TrialMeasurement::IsCancelled is_cancelled = {}) {
    auto promise = std::make_shared<std::promise<Result<TrialReading>>>();
    auto future = promise->get_future();
    measurement_ =
        TrialMeasurement::Start(hub_, clock_, pool_, options, std::move(is_cancelled),
                                [promise](const Result<TrialReading>& end) { promise->set_value(end); });
    return future;
  }

  void Publish(size_t link, double time_s, double force_n) {
    auto state = std::make_shared<LinkState>();
    state->status = LinkStatus::kOk;
    state->times.exposure_monotonic_ns = begin_ns_ + static_cast<int64_t>(1e9 * time_s);
    Contact contact;
    contact.center_mm = Vec3(40, 0, 90);
    contact.normal_force_n = force_n;
    state->contacts = {contact};
    hub_.Publish(link, std::move(state));
  }
  // Until the measurement has subscribed: what is published before is not its concern.
  void WaitUntilSubscribed() const {
    while (hub_.Totals().subscribers == 0) std::this_thread::yield();
  }

  ManualClock clock_;
  const int64_t begin_ns_ = clock_.MonotonicNs();
  Hub hub_{2, [](size_t, const LinkState&, Detail) { return std::string(); }};
  boost::asio::thread_pool pool_{1};
  std::shared_ptr<TrialMeasurement> measurement_;
};

TEST_F(TrialMeasurementTest, AveragesTheFramesExposedAfterItsStart) {
  clock_.Advance(std::chrono::seconds(10));
  auto end = Start({.link = 1, .duration_s = 1});
  WaitUntilSubscribed();
  Publish(1, 9.9, 7);   // was under way when the load was put on
  Publish(0, 10.1, 5);  // another link
  for (int i = 0; i <= 10; ++i) Publish(1, 10.1 + 0.1 * i, i < 10 ? 0.5 : 0.6);
  const auto reading = end.get();
  ASSERT_TRUE(reading.ok()) << reading.error().message;
  EXPECT_EQ(reading->frames, 11);
  EXPECT_NEAR(reading->force_n, 5.6 / 11, 1e-12);
  EXPECT_NEAR(reading->duration_s, 1, 1e-9);
  EXPECT_EQ(hub_.Totals().subscribers, 0u);
}

TEST_F(TrialMeasurementTest, SilentLinkIsAnError) {
  auto end = Start({.link = 0});
  WaitUntilSubscribed();
  clock_.Advance(std::chrono::seconds(6));
  const auto reading = end.get();
  ASSERT_FALSE(reading.ok());
  EXPECT_EQ(reading.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(reading.error().message, HasSubstr("no frames"));
}

TEST_F(TrialMeasurementTest, CallerWhoHasGoneEndsIt) {
  std::atomic<bool> is_gone{false};
  auto end = Start({.link = 0}, [&is_gone] { return is_gone.load(); });
  WaitUntilSubscribed();
  is_gone = true;
  EXPECT_FALSE(end.get().ok());
}

TEST_F(TrialMeasurementTest, ServerThatEndsEndsIt) {
  auto end = Start({.link = 0});
  measurement_->End({ErrorCode::kUnavailable, "shutting down"});
  measurement_->End({ErrorCode::kUnavailable, "again"});
  const auto reading = end.get();
  ASSERT_FALSE(reading.ok());
  EXPECT_EQ(reading.error().message, "shutting down");
}

}  // namespace
}  // namespace taclink::server

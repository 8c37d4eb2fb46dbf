// A simulated pressure regulator under its controller, as clients set and see it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/pressure/pressure_controller.h"
#include "server/simulation/simulated_regulator.h"
#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

class RegulatorTest : public ::testing::Test {
 protected:
  /// "upper" has a regulator. Its control loop runs as the test says (Run), by the fake clock.
  RegulatorTest()
      : server_(TestLimits(), nullptr,
                [this](size_t link, Clock& clock) -> std::unique_ptr<PressureSource> {
                  if (link != 0) return nullptr;
                  regulator_ = std::make_shared<SimulatedRegulator>(SimulatedRegulatorOptions{}, 1, clock);
                  auto controller =
                      std::make_unique<PressureController>("upper", MakeSimulatedActuator(regulator_),
                                                           RegulatorOptions{}, milliseconds(500), clock);
                  controller_ = controller.get();
                  return controller;
                }),
        connection_(server_.Connect()) {
    server_.clock().LetSleepingPassTime();
    server_.arm().events().Start();
    auto events = connection_.StreamEvents(EventsOf({v1::EVENT_KIND_PRESSURE_TRIP}));
    EXPECT_TRUE(events.ok()) << events.error().message;
    events_ = std::move(*events);
    Run(0.1);
  }
  ~RegulatorTest() override { server_.arm().events().Stop(); }

  void Run(double span_s) {
    const int64_t until = server_.clock().MonotonicNs() + std::llround(1e9 * span_s);
    while (server_.clock().MonotonicNs() < until) controller_->Step(milliseconds(20));
  }
  Result<v1::PressureRegulator> Set(double pressure_pa, bool reset = false,
                                    std::optional<double> ramp_pa_per_s = {}) {
    v1::SetPressureRequest request;
    request.set_link("upper");
    request.set_pressure_pa(pressure_pa);
    request.set_reset_trip(reset);
    if (ramp_pa_per_s) request.set_ramp_pa_per_s(*ramp_pa_per_s);
    return connection_.SetPressure(request);
  }
  v1::PressureRegulator Get() {
    const auto regulator = connection_.GetPressure("upper");
    EXPECT_TRUE(regulator.ok()) << regulator.error().message;
    return regulator.ok() ? *regulator : v1::PressureRegulator();
  }
  v1::Event NextEvent() {
    const auto event = events_->Next(kForever);
    EXPECT_TRUE(event.ok()) << event.error().message;
    return event.ok() ? *event : v1::Event();
  }
  void ExpectTrip(v1::PressureTripCause cause, const std::string& text) {
    const v1::PressureRegulator regulator = Get();
    ASSERT_EQ(regulator.state(), v1::REGULATOR_STATE_TRIPPED);
    EXPECT_EQ(regulator.trip().cause(), cause) << regulator.trip().text();
    EXPECT_THAT(regulator.trip().text(), HasSubstr(text));
    EXPECT_FALSE(regulator.has_setpoint_pa());
    const v1::Event event = NextEvent();
    EXPECT_EQ(event.kind(), v1::EVENT_KIND_PRESSURE_TRIP);
    EXPECT_EQ(event.link(), "upper");
    EXPECT_FALSE(event.operation().accepted());
    EXPECT_EQ(event.operation().outcome(), regulator.trip().text());
    EXPECT_EQ(event.operation().values().at("measured"), regulator.trip().measured());
    EXPECT_EQ(event.operation().values().at("limit"), regulator.trip().limit());
    Run(4);
    EXPECT_LT(regulator_->AirNow().kpa, 0.01) << "vented";
  }

  std::shared_ptr<SimulatedRegulator> regulator_;
  PressureController* controller_ = nullptr;  // owned by the server's arm
  TestServer server_;
  client::Client connection_;
  std::unique_ptr<client::EventReader> events_;
};

TEST_F(RegulatorTest, TheSetpointRampsAndThePressureFollows) {
  EXPECT_EQ(Get().state(), v1::REGULATOR_STATE_CLOSED);
  const auto set = Set(1500);
  ASSERT_TRUE(set.ok()) << set.error().message;
  EXPECT_EQ(set->state(), v1::REGULATOR_STATE_RAMPING);
  EXPECT_EQ(set->target_pa(), 1500);
  EXPECT_EQ(set->ramp_pa_per_s(), 500);
  Run(1.5);
  EXPECT_NEAR(Get().setpoint_pa(), 750, 30);
  EXPECT_NEAR(Get().measured_pa(), 1e3 * regulator_->AirNow().kpa, 60) << "noise of 10 Pa, 20 ms old";
  EXPECT_NEAR(1e3 * regulator_->AirNow().kpa, 750 - 500 * 0.2, 30) << "behind by its time constant";
  Run(3);
  EXPECT_EQ(Get().state(), v1::REGULATOR_STATE_HOLDING);
  EXPECT_NEAR(1e3 * regulator_->AirNow().kpa, 1500, 10);
  const auto arm = connection_.GetArm();
  ASSERT_TRUE(arm.ok());
  EXPECT_EQ(arm->links(0).regulator().state(), v1::REGULATOR_STATE_HOLDING);
  EXPECT_EQ(arm->links(0).regulator().max_pa(), 1500);
  EXPECT_FALSE(arm->links(1).has_regulator());

  ASSERT_TRUE(Set(500, false, 100).ok());
  Run(5);
  EXPECT_NEAR(1e3 * regulator_->AirNow().kpa, 1000, 40) << "at 100 Pa/s";
  v1::SetPressureRequest vent;
  vent.set_link("upper");
  vent.set_vent(true);
  ASSERT_TRUE(connection_.SetPressure(vent).ok());
  Run(4);
  EXPECT_EQ(Get().state(), v1::REGULATOR_STATE_CLOSED);
  EXPECT_LT(regulator_->AirNow().kpa, 0.01);
}

TEST_F(RegulatorTest, ALeakTrips) {
  ASSERT_TRUE(Set(1000).ok());
  Run(4);
  regulator_->SetFaults({.leak_per_s = 0.8});
  Run(12);
  ExpectTrip(v1::PRESSURE_TRIP_CAUSE_LEAK, "holding 1.000 kPa takes");
}

TEST_F(RegulatorTest, ALostSensorTrips) {
  ASSERT_TRUE(Set(1000).ok());
  Run(4);
  regulator_->SetFaults({.is_silent = true});
  Run(1);
  ExpectTrip(v1::PRESSURE_TRIP_CAUSE_SENSOR_LOST, "no reading for");
  const auto refused = Set(500, true);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(refused.error().message, HasSubstr("gives no reading"));
}

TEST_F(RegulatorTest, OverPressureTripsAndIsReset) {
  ASSERT_TRUE(Set(1500).ok());
  Run(5);
  regulator_->SetFaults({.stuck_kpa = 2.4});
  Run(1);
  const auto refused = Set(500);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("has tripped"));
  regulator_->SetFaults({});
  ExpectTrip(v1::PRESSURE_TRIP_CAUSE_OVER_PRESSURE, "limit 2.000 kPa");

  const auto reset = Set(500, true);
  ASSERT_TRUE(reset.ok()) << reset.error().message;
  EXPECT_FALSE(reset->has_trip());
  const v1::Event event = NextEvent();
  EXPECT_TRUE(event.operation().accepted());
  EXPECT_EQ(event.operation().outcome(), "reset");
  Run(3);
  EXPECT_EQ(Get().state(), v1::REGULATOR_STATE_HOLDING);
}

TEST_F(RegulatorTest, BadRequestsAreRefusedWithTheReason) {
  const auto message = [&](double pressure_pa) { return Set(pressure_pa).error().message; };
  EXPECT_THAT(message(std::numeric_limits<double>::quiet_NaN()), HasSubstr("pressure_pa must be a finite"));
  EXPECT_THAT(message(-1), HasSubstr("pressure_pa must be 0 to"));
  EXPECT_THAT(message(1600), HasSubstr("not within 0 and 1.5 kPa"));
  EXPECT_THAT(Set(500, false, 0).error().message, HasSubstr("not above 0 and at most 0.5 kPa/s"));
  EXPECT_THAT(Set(500, false, 501).error().message, HasSubstr("at most 0.5 kPa/s"));
  v1::SetPressureRequest request;
  request.set_link("upper");
  EXPECT_THAT(connection_.SetPressure(request).error().message, HasSubstr("neither pressure_pa nor vent"));
  request.set_vent(false);
  EXPECT_THAT(connection_.SetPressure(request).error().message, HasSubstr("vent must be true"));
  request.set_pressure_pa(100);
  request.set_link("lower");
  EXPECT_EQ(connection_.SetPressure(request).error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(connection_.SetPressure(request).error().message, HasSubstr("{source: regulator}"));
  request.set_link("nobody");
  EXPECT_EQ(connection_.SetPressure(request).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(connection_.GetPressure("lower").error().code, ErrorCode::kFailedPrecondition);
  EXPECT_EQ(Get().state(), v1::REGULATOR_STATE_CLOSED) << "nothing has changed";
}

TEST_F(RegulatorTest, AFloodOfRequestsLeavesTheNewest) {
  for (int i = 0; i < 500; ++i) ASSERT_TRUE(Set(100 + i).ok());
  Run(2);
  EXPECT_EQ(Get().target_pa(), 599);
  EXPECT_EQ(Get().setpoint_pa(), 599);
}

}  // namespace
}  // namespace taclink::server

#include "server/pressure/pressure_controller.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "tests/server/support.h"
#include "tests/support/times.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr milliseconds kPeriod{20};  // of the device's readings
constexpr double kPeriodS = 0.02;

/// A regulator that does as the test says. A reading takes kPeriod of the fake clock.
struct ScriptedDevice {
  explicit ScriptedDevice(ManualClock& device_clock) : clock(device_clock) {}

  ManualClock& clock;
  bool is_there = true, is_silent = false, takes_commands = true;
  std::optional<Error> error;
  std::optional<double> effort;
  /// What the sensor shows at a command; as commanded by default.
  std::function<double(std::optional<double>)> shows = [](std::optional<double> kpa) {
    return kpa.value_or(0);
  };
  std::vector<std::optional<double>> commands;

  std::optional<double> commanded() const { return commands.empty() ? std::nullopt : commands.back(); }
};

class ScriptedActuator final : public PressureActuator {
 public:
  explicit ScriptedActuator(std::shared_ptr<ScriptedDevice> device) : device_(std::move(device)) {}
  Result<void> Open() override {
    if (device_->is_there) return {};
    return Error{ErrorCode::kUnavailable, "regulator: unplugged"};
  }
  Result<void> Command(std::optional<double> kpa) override {
    if (!device_->takes_commands) return Error{ErrorCode::kUnavailable, "regulator: takes no more commands"};
    device_->commands.push_back(kpa);
    return {};
  }
  Result<RegulatorReading> Read(milliseconds timeout) override {
    device_->clock.Advance(std::min(timeout, kPeriod));
    if (!device_->is_there) return Error{ErrorCode::kUnavailable, "regulator: unplugged"};
    if (device_->error) return *device_->error;
    if (device_->is_silent) return Error{ErrorCode::kTimeout, "nothing"};
    return RegulatorReading{.time_ns = device_->clock.MonotonicNs(),
                            .kpa = device_->shows(device_->commanded()),
                            .effort = device_->effort};
  }

 private:
  const std::shared_ptr<ScriptedDevice> device_;
};

class PressureControllerTest : public ::testing::Test {
 protected:
  PressureControllerTest() {
    clock_.LetSleepingPassTime();
    controller_.OnTrip([this](const PressureTrip& trip) { trips_.push_back(trip); });
    Run(0.1);
  }

  void Run(double span_s) {
    const int64_t until = clock_.MonotonicNs() + std::llround(1e9 * span_s);
    while (clock_.MonotonicNs() < until) controller_.Step(kPeriod);
  }
  /// At a pressure, holding.
  void Hold(double kpa) {
    ASSERT_TRUE(controller_.Set({.kpa = kpa}).ok());
    Run(kpa / 0.5 + 0.1);
    ASSERT_EQ(controller_.Status().state, RegulatorState::kHolding);
  }
  /// Runs until a trip, at most this long; returns how long it took.
  double RunToTrip(double at_most_s) {
    const int64_t begin = clock_.MonotonicNs();
    while (trips_.empty() && static_cast<double>(clock_.MonotonicNs() - begin) * 1e-9 < at_most_s)
      controller_.Step(kPeriod);
    return static_cast<double>(clock_.MonotonicNs() - begin) * 1e-9;
  }
  void ExpectTrip(PressureTripCause cause, const std::string& text) {
    ASSERT_EQ(trips_.size(), 1u);
    EXPECT_EQ(trips_[0].cause, cause) << trips_[0].text;
    EXPECT_THAT(trips_[0].text, HasSubstr(text));
    EXPECT_LE(clock_.UtcNs() - trips_[0].utc_ns, kPeriod / std::chrono::nanoseconds(1));
    const RegulatorStatus status = controller_.Status();
    EXPECT_EQ(status.state, RegulatorState::kTripped);
    EXPECT_FALSE(status.setpoint_kpa.has_value());
    EXPECT_EQ(status.trip->text, trips_[0].text);
    if (device_->is_there && device_->takes_commands) {
      EXPECT_EQ(device_->commanded(), std::nullopt) << "the valve was closed in the same cycle";
    }
  }

  ManualClock clock_;
  const std::shared_ptr<ScriptedDevice> device_ = std::make_shared<ScriptedDevice>(clock_);
  PressureController controller_{"upper", std::make_unique<ScriptedActuator>(device_), RegulatorOptions{},
                                 milliseconds(500), clock_};
  std::vector<PressureTrip> trips_;
};

TEST_F(PressureControllerTest, TheSetpointRampsAtTheConfiguredRateAndArrives) {
  EXPECT_EQ(controller_.Status().state, RegulatorState::kClosed);
  ASSERT_TRUE(controller_.Set({.kpa = 1.5}).ok());
  const int64_t begin = clock_.MonotonicNs();
  double before = 0;
  while (controller_.Status().state != RegulatorState::kHolding) {
    controller_.Step(kPeriod);
    const double passed_s = static_cast<double>(clock_.MonotonicNs() - begin) * 1e-9;
    const double setpoint = controller_.Status().setpoint_kpa.value();
    EXPECT_GE(setpoint, before);
    EXPECT_LE(setpoint - before, 0.5 * kPeriodS + 1e-12);
    EXPECT_NEAR(setpoint, std::min(1.5, 0.5 * passed_s), 0.5 * kPeriodS + 1e-9);
    before = setpoint;
    ASSERT_LT(passed_s, 4);
  }
  EXPECT_NEAR(static_cast<double>(clock_.MonotonicNs() - begin) * 1e-9, 3, 2 * kPeriodS);
  EXPECT_EQ(controller_.Status().setpoint_kpa, 1.5) << "exactly";
  Run(0.1);
  EXPECT_EQ(device_->commanded(), 1.5);
  EXPECT_TRUE(trips_.empty());
}

TEST_F(PressureControllerTest, ASlowerRampAndTheNewestOrderCount) {
  for (int i = 0; i < 5000; ++i)  // a flood: each at once, none queued
    ASSERT_TRUE(controller_.Set({.kpa = 0.1 + 0.0001 * i, .ramp_kpa_per_s = 0.25}).ok());
  ASSERT_TRUE(controller_.Set({.kpa = 0.5, .ramp_kpa_per_s = 0.1}).ok());
  Run(1);
  EXPECT_NEAR(controller_.Status().setpoint_kpa.value(), 0.1, 0.01);
  EXPECT_EQ(controller_.Status().target_kpa, 0.5);
  ASSERT_TRUE(controller_.Set({.kpa = 0}).ok());
  EXPECT_EQ(controller_.Status().state, RegulatorState::kRamping) << "down again";
  Run(0.5);
  EXPECT_EQ(controller_.Status().state, RegulatorState::kHolding);
  EXPECT_EQ(controller_.Status().setpoint_kpa, 0.0);
}

TEST_F(PressureControllerTest, BadOrdersAreRefusedAndChangeNothing) {
  Hold(0.5);
  using Limits = std::numeric_limits<double>;
  for (const double bad : {-0.1, 1.6, 1e9, Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
    const auto set = controller_.Set({.kpa = bad});
    ASSERT_FALSE(set.ok()) << bad;
    EXPECT_EQ(set.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(set.error().message, HasSubstr("not within 0 and 1.5 kPa"));
  }
  for (const double bad : {-0.1, 0.0, 0.6, Limits::quiet_NaN()}) {
    const auto set = controller_.Set({.kpa = 1, .ramp_kpa_per_s = bad});
    ASSERT_FALSE(set.ok()) << bad;
    EXPECT_THAT(set.error().message, HasSubstr("at most 0.5 kPa/s"));
  }
  EXPECT_EQ(controller_.Status().target_kpa, 0.5);
}

TEST_F(PressureControllerTest, VentingClosesTheValveAtOnce) {
  Hold(1);
  const auto set = controller_.Set({});
  ASSERT_TRUE(set.ok());
  EXPECT_EQ(set->status.state, RegulatorState::kClosed);
  EXPECT_FALSE(set->ended_a_trip);
  controller_.Step(kPeriod);
  EXPECT_EQ(device_->commanded(), std::nullopt);
  // A new setpoint begins at the pressure that is left.
  device_->shows = [](std::optional<double> kpa) { return kpa.value_or(0.6); };
  Run(0.1);
  ASSERT_TRUE(controller_.Set({.kpa = 1}).ok());
  EXPECT_NEAR(controller_.Status().setpoint_kpa.value(), 0.6, 1e-12);
  Run(1);
  EXPECT_TRUE(trips_.empty());
}

TEST_F(PressureControllerTest, TheCommandIsRepeatedAsAHeartbeat) {
  Hold(0.2);
  device_->commands.clear();
  Run(2);
  EXPECT_GE(device_->commands.size(), 2000u / 120) << "well within the device's watchdog of 500 ms";
  EXPECT_LE(device_->commands.size(), 21u);
  controller_.Stop();
  EXPECT_EQ(device_->commanded(), std::nullopt) << "a server that ends vents the skin";
  EXPECT_EQ(controller_.Status().state, RegulatorState::kClosed);
}

TEST_F(PressureControllerTest, OverPressureTrips) {
  Hold(1);
  double shown = 1;
  device_->shows = [&](std::optional<double>) { return shown += 0.03; };
  RunToTrip(2);
  // 2.02 kPa is the first above 2, unless the pressure has not followed for a second before.
  ASSERT_EQ(trips_.size(), 1u);
  ExpectTrip(PressureTripCause::kOverPressure, "limit 2.000 kPa");
  EXPECT_NEAR(trips_[0].measured.value(), 2.02, 0.02);
}

TEST_F(PressureControllerTest, OverPressureTripsAlsoWhileTheValveIsClosed) {
  device_->shows = [](std::optional<double>) { return 2.2; };
  RunToTrip(0.1);
  ExpectTrip(PressureTripCause::kOverPressure, "2.200 kPa measured");
  const auto set = controller_.Set({.kpa = 0.5, .reset_trip = true});
  ASSERT_FALSE(set.ok());
  EXPECT_THAT(set.error().message, HasSubstr("stays closed: over-pressure"));
}

// A sensor that is saturated, or whose device sends Pa: no frame can use that, but the valve must close.
TEST_F(PressureControllerTest, AReadingBeyondWhatFramesTakeTripsAsWell) {
  Hold(0.5);
  device_->shows = [](std::optional<double>) { return 1250.0; };
  RunToTrip(0.1);
  ExpectTrip(PressureTripCause::kOverPressure, "1250.000 kPa measured");
}

TEST_F(PressureControllerTest, UnderPressureTrips) {
  Hold(0.1);
  device_->shows = [](std::optional<double> kpa) { return kpa ? -0.25 : 0; };
  RunToTrip(0.2);
  ExpectTrip(PressureTripCause::kUnderPressure, "-0.250 kPa measured, limit -0.200 kPa");
}

TEST_F(PressureControllerTest, ASilentSensorTrips) {
  Hold(1);
  device_->is_silent = true;
  EXPECT_NEAR(RunToTrip(2), 0.5, 0.05);
  ExpectTrip(PressureTripCause::kSensorLost, "limit 0.50 s");
  StereoFrame frame;
  frame.times.exposure_monotonic_ns = clock_.MonotonicNs();
  controller_.Apply(frame);
  EXPECT_TRUE(frame.pressure.stale);
  EXPECT_EQ(frame.pressure.origin, PressureOrigin::kRegulator);
  const auto set = controller_.Set({.kpa = 0.5, .reset_trip = true});
  ASSERT_FALSE(set.ok()) << "nobody can say how high the pressure is";
  EXPECT_EQ(set.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(set.error().message, HasSubstr("gives no reading"));
}

TEST_F(PressureControllerTest, AnUnpluggedRegulatorTripsAndIsFoundAgain) {
  Hold(1);
  device_->is_there = false;
  RunToTrip(0.2);
  ExpectTrip(PressureTripCause::kSensorLost, "unplugged");
  EXPECT_THAT(controller_.Status().trouble, HasSubstr("unplugged; trying again"));
  Run(10);
  device_->is_there = true;
  device_->commands.clear();
  Run(3);
  ASSERT_FALSE(device_->commands.empty());
  EXPECT_THAT(device_->commands, ::testing::Each(std::optional<double>())) << "it returns closed";
  EXPECT_EQ(controller_.Status().trouble, "");
  ASSERT_TRUE(controller_.Set({.kpa = 0.3, .reset_trip = true}).ok());
  Run(1);
  EXPECT_EQ(controller_.Status().state, RegulatorState::kHolding);
}

TEST_F(PressureControllerTest, ADeviceThatTakesNoCommandsTrips) {
  Hold(1);
  device_->takes_commands = false;
  RunToTrip(0.5);
  ExpectTrip(PressureTripCause::kSensorLost, "takes no more commands");
}

TEST_F(PressureControllerTest, AStuckValveTrips) {
  Hold(0.5);
  device_->shows = [](std::optional<double>) { return 0.5; };
  ASSERT_TRUE(controller_.Set({.kpa = 1.5}).ok());
  // The setpoint is 0.3 kPa away after 0.6 s, and must stay so for a second.
  EXPECT_NEAR(RunToTrip(4), 1.6, 0.1);
  ExpectTrip(PressureTripCause::kNotFollowing, "limit 0.300 kPa for 1 s");
}

TEST_F(PressureControllerTest, ALagWithinTheLimitIsNoTrip) {
  double shown = 0;
  device_->shows = [&](std::optional<double> kpa) {
    return shown += kPeriodS / 0.4 * (kpa.value_or(0) - shown);  // a lag of 0.4 s: 0.2 kPa on the ramp
  };
  ASSERT_TRUE(controller_.Set({.kpa = 1.5}).ok());
  Run(6);
  EXPECT_EQ(controller_.Status().state, RegulatorState::kHolding);
  EXPECT_TRUE(trips_.empty());
}

TEST_F(PressureControllerTest, AnImplausibleJumpTrips) {
  Hold(0.5);
  device_->shows = [](std::optional<double> kpa) { return kpa.value_or(0) + 0.45; };
  RunToTrip(0.1);
  ExpectTrip(PressureTripCause::kJump, "from 0.500 to 0.950 kPa");
  EXPECT_NEAR(trips_[0].measured.value(), 0.45, 1e-9);
  EXPECT_NEAR(trips_[0].limit.value(), 0.4 + 0.5 * kPeriodS, 1e-9);
}

TEST_F(PressureControllerTest, AnEffortThatIsTooHighForAHeldPressureIsALeak) {
  device_->effort = 0.9;
  ASSERT_TRUE(controller_.Set({.kpa = 1.5}).ok());
  Run(2.9);
  EXPECT_TRUE(trips_.empty()) << "a ramp takes effort";
  RunToTrip(5);
  ExpectTrip(PressureTripCause::kLeak, "holding 1.500 kPa takes 90 %");
  EXPECT_NEAR(trips_[0].measured.value(), 0.9, 1e-6);
}

TEST_F(PressureControllerTest, AShortEffortIsNoLeak) {
  Hold(1);
  for (int i = 0; i < 20; ++i) {
    device_->effort = 0.8;
    Run(0.4);
    device_->effort = 0.1;
    Run(0.6);
  }
  EXPECT_TRUE(trips_.empty()) << trips_[0].text;
}

TEST_F(PressureControllerTest, AnErrorOfTheDeviceTrips) {
  Hold(0.5);
  device_->error = Error{ErrorCode::kFailedPrecondition, "the regulator reports: supply too low"};
  RunToTrip(0.1);
  ExpectTrip(PressureTripCause::kDevice, "supply too low");
  EXPECT_FALSE(trips_[0].measured.has_value());
}

TEST_F(PressureControllerTest, NonsenseIsIgnoredUntilTheReadingIsStale) {
  Hold(0.5);
  device_->error = Error{ErrorCode::kInvalidArgument, "regulator: 'abc' is not a message"};
  Run(0.3);
  EXPECT_TRUE(trips_.empty());
  EXPECT_THAT(controller_.Status().trouble, HasSubstr("'abc'"));
  RunToTrip(0.5);
  ExpectTrip(PressureTripCause::kSensorLost, "no reading for");
}

TEST_F(PressureControllerTest, ALoopThatStoodStillTrips) {
  Hold(1);
  clock_.Advance(std::chrono::milliseconds(700));
  EXPECT_THAT(controller_.Status().trouble, HasSubstr("has not run for 0.7 s"));
  EXPECT_EQ(controller_.Set({.kpa = 0.5}).ok(), true) << "the valve is open: no check of readings";
  controller_.Step(kPeriod);
  ASSERT_EQ(trips_.size(), 1u);
  EXPECT_EQ(trips_[0].cause, PressureTripCause::kLoopStalled) << "the device has closed by itself";
}

// The device's watchdog counts from the last command: it may have vented already.
TEST_F(PressureControllerTest, ACommandThatIsLateTripsBeforeItFillsTheSkinAtOnce) {
  Hold(1);
  clock_.Advance(std::chrono::milliseconds(420));
  device_->commands.clear();
  controller_.Step(kPeriod);
  ASSERT_EQ(trips_.size(), 1u);
  EXPECT_EQ(trips_[0].cause, PressureTripCause::kLoopStalled);
  EXPECT_THAT(device_->commands, ::testing::Each(std::optional<double>()));
}

TEST_F(PressureControllerTest, AClockThatIsSetChangesNothing) {
  ASSERT_TRUE(controller_.Set({.kpa = 1}).ok());
  Run(1);
  clock_.StepUtc(-std::chrono::hours(24));
  Run(0.2);
  clock_.StepUtc(std::chrono::hours(48));
  Run(1.5);
  EXPECT_TRUE(trips_.empty());
  EXPECT_EQ(controller_.Status().state, RegulatorState::kHolding);
}

TEST_F(PressureControllerTest, ATripStaysUntilItIsReset) {
  Hold(0.5);
  device_->shows = [](std::optional<double> kpa) { return kpa ? -1.0 : 0; };
  RunToTrip(0.1);
  ASSERT_EQ(trips_.size(), 1u);
  device_->shows = [](std::optional<double> kpa) { return kpa.value_or(0); };
  Run(5);
  const auto refused = controller_.Set({.kpa = 0.5});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(refused.error().message, HasSubstr("under-pressure"));
  EXPECT_THAT(refused.error().message, HasSubstr("reset_trip"));
  ASSERT_TRUE(controller_.Set({}).ok()) << "venting is always allowed";
  EXPECT_EQ(controller_.Status().state, RegulatorState::kTripped) << "and resets nothing";
  const auto reset = controller_.Set({.kpa = 0.5, .reset_trip = true});
  ASSERT_TRUE(reset.ok()) << reset.error().message;
  EXPECT_TRUE(reset->ended_a_trip);
  EXPECT_FALSE(reset->status.trip.has_value());
  Run(2);
  EXPECT_EQ(controller_.Status().state, RegulatorState::kHolding);
  EXPECT_EQ(trips_.size(), 1u);
}

TEST_F(PressureControllerTest, WithoutItsLoopItOpensNoValve) {
  clock_.Advance(std::chrono::seconds(1));
  const auto set = controller_.Set({.kpa = 0.5});
  ASSERT_FALSE(set.ok());
  EXPECT_EQ(set.error().code, ErrorCode::kUnavailable);
}

// The whole way with its own thread and the system's clock.
TEST(PressureControllerThread, VentsWhenItEnds) {
  ManualClock device_clock;
  const auto device = std::make_shared<ScriptedDevice>(device_clock);
  device->effort = 0.1;
  {
    PressureController controller("upper", std::make_unique<ScriptedActuator>(device), RegulatorOptions{},
                                  milliseconds(500), device_clock);
    controller.Start();
    const auto until = std::chrono::steady_clock::now() + kForever;
    while (!controller.Set({.kpa = 0.4}).ok() && std::chrono::steady_clock::now() < until) {
    }
    while (controller.Status().state != RegulatorState::kHolding &&
           std::chrono::steady_clock::now() < until) {
    }
    EXPECT_EQ(controller.Status().state, RegulatorState::kHolding);
  }
  EXPECT_EQ(device->commanded(), std::nullopt);
}

}  // namespace
}  // namespace taclink::server

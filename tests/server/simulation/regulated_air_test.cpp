#include "server/simulation/regulated_air.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/simulation/simulated_regulator.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;

/// The same equation by small steps of the classical Runge-Kutta method.
double Integrated(const SimulatedRegulatorOptions& options, double kpa, double commanded, double span_s) {
  const auto slope = [&](double p) {
    const double feed = std::clamp((commanded - p) / options.time_constant_s, -options.slew_kpa_per_s,
                                   options.slew_kpa_per_s);
    return feed - options.leak_per_s * p;
  };
  constexpr int kSteps = 20000;
  const double h = span_s / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    const double a = slope(kpa), b = slope(kpa + h / 2 * a), c = slope(kpa + h / 2 * b),
                 d = slope(kpa + h * c);
    kpa += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return kpa;
}

TEST(RegulatedAir, IsTheSolutionOfItsEquation) {
  for (const double leak : {0.0, 0.05, 2.0}) {
    for (const double slew : {0.2, 1.0}) {
      const SimulatedRegulatorOptions options{
          .time_constant_s = 0.3, .slew_kpa_per_s = slew, .leak_per_s = leak};
      for (const double span_s : {0.01, 0.4, 1.3, 6.0}) {
        RegulatedAir air(options);
        double expected = 0;
        for (const double commanded : {1.5, 0.7, 0.75, 0.0}) {
          air.Command(commanded);
          air.Advance(span_s);
          expected = Integrated(options, expected, commanded, span_s);
          EXPECT_NEAR(air.kpa(), expected, 1e-5) << leak << " " << slew << " " << span_s << " " << commanded;
        }
      }
    }
  }
}

TEST(RegulatedAir, DoesNotDependOnHowItsTimeIsCut) {
  const SimulatedRegulatorOptions options{.time_constant_s = 0.3, .leak_per_s = 0.1};
  RegulatedAir whole(options), cut(options);
  whole.Command(1.2);
  cut.Command(1.2);
  whole.Advance(2.5);
  for (int i = 0; i < 2500; ++i) cut.Advance(1e-3);
  EXPECT_NEAR(whole.kpa(), cut.kpa(), 1e-10);
}

TEST(RegulatedAir, ALeakBeyondTheValvesRangeEmptiesTheSkin) {
  SimulatedRegulatorOptions options{.time_constant_s = 0.2, .slew_kpa_per_s = 1, .leak_per_s = 0};
  for (const double span_s : {0.05, 0.3, 5.0}) {
    RegulatedAir air(options);
    air.Command(1.5);
    air.Advance(60);
    air.SetExtraLeak(3);
    air.Advance(span_s);
    SimulatedRegulatorOptions torn = options;
    torn.leak_per_s = 3;
    EXPECT_NEAR(air.kpa(), Integrated(torn, 1.5, 1.5, span_s), 1e-5) << span_s;
  }
}

TEST(RegulatedAir, HoldsWithTheEffortOfItsLeak) {
  const SimulatedRegulatorOptions options{.time_constant_s = 0.2, .slew_kpa_per_s = 1, .leak_per_s = 0.1};
  RegulatedAir air(options);
  air.Command(1.0);
  air.Advance(60);
  EXPECT_NEAR(air.kpa(), 1 / (1 + 0.1 * 0.2), 1e-9) << "where feed and loss are equal";
  EXPECT_NEAR(air.effort(), 0.1 * air.kpa(), 1e-9);
  EXPECT_NEAR(air.kpa_per_s(), 0, 1e-9);
}

class SimulatedRegulatorTest : public ::testing::Test {
 protected:
  SimulatedRegulatorTest() { clock_.LetSleepingPassTime(); }
  ManualClock clock_;
  SimulatedRegulator regulator_{{.noise_pa = 20, .offset_pa = 30, .gain_error = 0.1}, 7, clock_};
};

TEST_F(SimulatedRegulatorTest, ClosesByItselfWithoutCommands) {
  ASSERT_TRUE(regulator_.Command(0.8).ok());
  for (int i = 0; i < 20; ++i) {  // a heartbeat
    clock_.Advance(milliseconds(100));
    ASSERT_TRUE(regulator_.Command(0.8).ok());
  }
  EXPECT_NEAR(regulator_.AirNow().kpa, 0.8, 0.01);
  clock_.Advance(PressureActuator::kDeviceWatchdog);
  EXPECT_NEAR(regulator_.AirNow().kpa, 0.8, 0.01);
  clock_.Advance(milliseconds(1));
  EXPECT_LT(regulator_.AirNow().kpa_per_s, -0.5);
  clock_.Advance(std::chrono::seconds(4));
  EXPECT_LT(regulator_.AirNow().kpa, 1e-3);
}

TEST_F(SimulatedRegulatorTest, ItsSensorHasTheConfiguredErrors) {
  double sum = 0, squares = 0;
  constexpr int kReadings = 4000;
  for (int i = 0; i < kReadings; ++i) {
    ASSERT_TRUE(regulator_.Command(1.0).ok());
    const auto reading = regulator_.Read(milliseconds(50));
    ASSERT_TRUE(reading.ok()) << reading.error().message;
    const double error_pa = 1e3 * (reading->kpa - 1.1 * regulator_.AirNow().kpa);
    sum += error_pa;
    squares += error_pa * error_pa;
  }
  const double mean = sum / kReadings;
  EXPECT_NEAR(mean, 30, 4 * 20 / std::sqrt(kReadings));
  EXPECT_NEAR(std::sqrt(squares / kReadings - mean * mean), 20, 1);
}

}  // namespace
}  // namespace taclink::server

#include "server/pressure/serial_regulator.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "server/pressure/line_reader.h"
#include "server/pressure/pressure_controller.h"
#include "tests/server/pressure/pseudo_terminal.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

/// Reads until there is something else than a timeout.
Result<RegulatorReading> NextReading(PressureActuator& regulator) {
  const auto until = std::chrono::steady_clock::now() + kForever;
  while (std::chrono::steady_clock::now() < until) {
    auto reading = regulator.Read(milliseconds(10));
    if (reading || reading.error().code != ErrorCode::kTimeout) return reading;
  }
  return Error{ErrorCode::kTimeout, "nothing ever came"};
}

TEST(SerialRegulatorTest, SpeaksTheLineProtocol) {
  PseudoTerminal line;
  const auto regulator = MakeSerialRegulator(line.device(), 115200, SystemClock());
  ASSERT_TRUE(regulator->Open().ok());
  ASSERT_TRUE(regulator->Command(1.25).ok());
  ASSERT_TRUE(regulator->Command(std::nullopt).ok());
  EXPECT_EQ(line.Receive(), "P 1.2500");
  EXPECT_EQ(line.Receive(), "V");

  line.Send("25 0.5\n");  // the end of a line that began before
  line.Send("p 1.251\np 1.252 0.25\r\ne supply too low\np -0.003 0\n");
  auto reading = NextReading(*regulator);
  ASSERT_TRUE(reading.ok()) << reading.error().message;
  EXPECT_EQ(reading->kpa, 1.251);
  EXPECT_FALSE(reading->effort.has_value());
  reading = NextReading(*regulator);
  ASSERT_TRUE(reading.ok()) << reading.error().message;
  EXPECT_EQ(reading->kpa, 1.252);
  EXPECT_EQ(reading->effort, 0.25);
  reading = NextReading(*regulator);
  ASSERT_FALSE(reading.ok()) << "no line is skipped";
  EXPECT_EQ(reading.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(reading.error().message, HasSubstr("the regulator reports: supply too low"));
  EXPECT_EQ(NextReading(*regulator)->kpa, -0.003);

  line.Send("p 1.5 1.02\n");
  reading = NextReading(*regulator);
  ASSERT_TRUE(reading.ok()) << "an effort beyond its range takes no pressure with it";
  EXPECT_EQ(reading->kpa, 1.5);
  EXPECT_EQ(reading->effort, 1);
  for (const char* bad : {"1.25", "p", "p x", "p 1 x", "p 1 0.5 3", "q 1", "p nan", ""}) {
    line.Send(std::string(bad) + "\n");
    reading = NextReading(*regulator);
    ASSERT_FALSE(reading.ok()) << bad;
    EXPECT_EQ(reading.error().code, ErrorCode::kInvalidArgument) << bad;
  }
  line.Send("e \x01\xff" + std::string(1000, 'x') + "\n");
  reading = NextReading(*regulator);
  EXPECT_THAT(reading.error().message, HasSubstr("??xxx"));
  EXPECT_LT(reading.error().message.size(), 200u);

  line.Close();
  EXPECT_EQ(NextReading(*regulator).error().code, ErrorCode::kUnavailable);
  EXPECT_FALSE(regulator->Command(1).ok());
  EXPECT_THAT(regulator->Open().error().message, HasSubstr("cannot be opened"));
}

TEST(SerialRegulatorTest, ADeviceThatHangsKeepsNobodyWaiting) {
  PseudoTerminal line;  // nobody reads it
  const auto regulator = MakeSerialRegulator(line.device(), 115200, SystemClock());
  ASSERT_TRUE(regulator->Open().ok());
  Result<void> sent;
  for (int i = 0; i < 100'000 && sent; ++i) sent = regulator->Command(1.0);
  ASSERT_FALSE(sent.ok()) << "its buffer has an end";
  EXPECT_EQ(sent.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(sent.error().message, HasSubstr("takes no more commands"));
}

// A controller with its own thread and a device at the other end of a line.
TEST(SerialRegulatorTest, IsControlledOverItsLine) {
  PseudoTerminal line;
  PressureController controller("upper", MakeSerialRegulator(line.device(), 115200, SystemClock()),
                                {.ramp_kpa_per_s = 10}, milliseconds(60'000), SystemClock());
  controller.Start();
  double kpa = 0;
  int vents = 0;
  const auto serve = [&](auto until) {
    const auto end = std::chrono::steady_clock::now() + kForever;
    while (!until() && std::chrono::steady_clock::now() < end) {
      const std::string command = line.Receive();
      vents = command == "V" ? vents + 1 : 0;
      kpa = command == "V" ? 0 : std::stod(command.substr(2));
      line.Send("p " + std::to_string(kpa) + "\n");
    }
  };
  serve([&] { return controller.Set({.kpa = 1}).ok(); });
  serve([&] { return kpa == 1; });
  EXPECT_EQ(controller.Status().state, RegulatorState::kHolding);
  ASSERT_TRUE(controller.Set({}).ok());
  serve([&] { return vents > 0; });
  EXPECT_EQ(controller.Status().state, RegulatorState::kClosed);
  controller.Stop();
  EXPECT_EQ(line.Receive(), "V");
}

}  // namespace
}  // namespace taclink::server

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/config/config.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

std::string LinkText(const std::string& source, const std::string& pressure) {
  return "taclink_config: 1\narm:\n  name: a\n  links:\n    - {name: skin, model: cylinder, " + source +
         ", pose: {position_mm: [0, 0, 0]}, pressure: " + pressure + "}\n";
}
const std::string kSimulatedLink = "source: simulated, scene: rest, pace: clock";
const std::string kCameraLink = "source: v4l2, devices: [/dev/a, /dev/b]";

std::string Refusal(const std::string& source, const std::string& pressure) {
  const auto config = ParseConfig("arm.yaml", LinkText(source, pressure), "/etc");
  return config ? "accepted" : config.error().message;
}

TEST(RegulatorConfig, IsReadAndWrittenAgain) {
  const auto config = ParseConfig(
      "arm.yaml",
      LinkText(kCameraLink,
               "{source: regulator, device: /dev/r, baud: 9600, min_kpa: 0.1, max_kpa: 1.8, ramp_kpa_s: 0.2, "
               "stale_after_s: 0.4, sigma_pa: 30, trips: {over_kpa: 2.2, under_kpa: -1, jump_kpa: 0.3, "
               "follow_kpa: 0.2, follow_s: 2, leak_effort: 0.4, leak_s: 5}}"),
      "/etc");
  ASSERT_TRUE(config.ok()) << config.error().message;
  const PressureConfig& pressure = *config->links[0].pressure;
  EXPECT_EQ(pressure.stale_after_s, 0.4);
  EXPECT_EQ(pressure.sigma_pa, 30);
  const auto& regulated = std::get<RegulatorPressureConfig>(pressure.source);
  EXPECT_EQ(regulated.device, "/dev/r");
  EXPECT_EQ(regulated.baud, 9600);
  EXPECT_EQ(regulated.regulator.min_kpa, 0.1);
  EXPECT_EQ(regulated.regulator.max_kpa, 1.8);
  EXPECT_EQ(regulated.regulator.ramp_kpa_per_s, 0.2);
  EXPECT_EQ(regulated.regulator.trips.over_kpa, 2.2);
  EXPECT_EQ(regulated.regulator.trips.leak_s, 5);
  const std::string text = ConfigText(*config);
  const auto again = ParseConfig("arm.yaml", text, "/etc");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(ConfigText(*again), text);
}

TEST(RegulatorConfig, HasUsefulDefaults) {
  const auto config = ParseConfig("arm.yaml", LinkText(kSimulatedLink, "{source: regulator}"), "/etc");
  ASSERT_TRUE(config.ok()) << config.error().message;
  const auto& regulated = std::get<RegulatorPressureConfig>(config->links[0].pressure->source);
  EXPECT_FALSE(regulated.device.has_value());
  EXPECT_EQ(regulated.regulator.max_kpa, 1.5);
  EXPECT_EQ(regulated.regulator.ramp_kpa_per_s, 0.5);
}

TEST(RegulatorConfig, ErrorsSayWhatIsExpected) {
  EXPECT_THAT(Refusal(kCameraLink, "{source: regulator}"), HasSubstr("needs the 'device'"));
  EXPECT_THAT(Refusal(kSimulatedLink, "{source: regulator, device: /dev/r}"),
              HasSubstr("cannot inflate a simulated skin"));
  EXPECT_THAT(Refusal("source: simulated, scene: rest", "{source: regulator}"), HasSubstr("must be 'clock'"));
  const auto with = [](const std::string& keys) {
    return Refusal(kSimulatedLink, "{source: regulator, " + keys + "}");
  };
  EXPECT_THAT(with("max_kpa: 2.6"), HasSubstr("max_kpa"));
  EXPECT_THAT(with("min_kpa: 1.5"), HasSubstr("must be below max_kpa"));
  EXPECT_THAT(with("max_kpa: 2.2"), HasSubstr("over_kpa that is not above max_kpa"));
  EXPECT_EQ(with("max_kpa: 2.2, trips: {over_kpa: 2.4}"), "accepted");
  EXPECT_THAT(with("ramp_kpa_s: 0"), HasSubstr("ramp_kpa_s"));
  EXPECT_THAT(with("baud: 1234"), HasSubstr("usual rate"));
  EXPECT_THAT(with("simulation: {slew_kpa_s: 2}"), HasSubstr("slew_kpa_s"));
  EXPECT_THAT(with("trips: {follow: 1}"), HasSubstr("follow"));
  EXPECT_THAT(with("kpa_per_unit: 2"), HasSubstr("kpa_per_unit"));
}

}  // namespace
}  // namespace taclink::server

#include "server/simulation/simulation_desk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "sensing/model/model_file.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

PressedBody Finger(uint64_t id, double z_mm = 80) {
  return {.id = id,
          .shape = BodyShape::kFinger,
          .at = {.angle_rad = 0, .z_mm = z_mm},
          .depth_mm = 5,
          .force_n = std::nullopt};
}

class SimulationDeskTest : public ::testing::Test {
 protected:
  ManualClock clock_;
  SimulationDesk desk_{LoadLinkModel("cylinder").value(), LoadScene("rest").value(), clock_};
};

TEST_F(SimulationDeskTest, BodiesComeMoveAndGo) {
  ASSERT_TRUE(desk_.Press(Finger(1), 0).ok());
  ASSERT_TRUE(desk_.Press(Finger(2), 0).ok());
  ASSERT_TRUE(desk_.Press(Finger(1, 90), 0).ok());
  ASSERT_EQ(desk_.Now().bodies.size(), 2u);
  EXPECT_EQ(desk_.Now().bodies[0].at.z_mm, 90);
  ASSERT_TRUE(desk_.Release(1).ok());
  ASSERT_EQ(desk_.Now().bodies.size(), 1u);
  EXPECT_EQ(desk_.Now().bodies[0].id, 2u);
  EXPECT_EQ(desk_.Release(1).error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(desk_.Release(0).ok());
  EXPECT_FALSE(desk_.Now().any());
}

TEST_F(SimulationDeskTest, ABodyThatNobodyHoldsIsTakenOff) {
  ASSERT_TRUE(desk_.Press(Finger(1), 2).ok());
  ASSERT_TRUE(desk_.Press(Finger(2), 0).ok());
  clock_.Advance(std::chrono::milliseconds(1900));
  ASSERT_TRUE(desk_.Press(Finger(1), 2).ok());
  clock_.Advance(std::chrono::milliseconds(1900));
  EXPECT_EQ(desk_.Now().bodies.size(), 2u);
  clock_.Advance(std::chrono::milliseconds(200));
  ASSERT_EQ(desk_.Now().bodies.size(), 1u);
  EXPECT_EQ(desk_.Now().bodies[0].id, 2u);
}

TEST_F(SimulationDeskTest, WhatIsRefusedChangesNothing) {
  ASSERT_TRUE(desk_.Press(Finger(1), 0).ok());
  const auto refused = desk_.Press(Finger(1, -1), 0);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("between the clamped ends"));
  EXPECT_EQ(desk_.Now().bodies[0].at.z_mm, 80);
  EXPECT_FALSE(desk_.SetPressure(1).ok());
  EXPECT_FALSE(desk_.MoveJoint(0.5).ok());
  EXPECT_FALSE(desk_.Now().pressure_mpa || desk_.Now().joint_rad);
  ASSERT_TRUE(desk_.SetPressure(0.001).ok());
  EXPECT_EQ(desk_.Now().pressure_mpa, 0.001);
  ASSERT_TRUE(desk_.SetPressure(std::nullopt).ok());
  EXPECT_FALSE(desk_.Now().pressure_mpa.has_value());
}

TEST_F(SimulationDeskTest, ARegulatorSetsThePressure) {
  const auto regulator = std::make_shared<SimulatedRegulator>(SimulatedRegulatorOptions{}, 1, clock_);
  SimulationDesk desk(LoadLinkModel("cylinder").value(), LoadScene("rest").value(), clock_, regulator);
  EXPECT_FALSE(desk.Now().any()) << "a vented skin is left to its scene";
  ASSERT_TRUE(regulator->Command(1.0).ok());
  clock_.Advance(std::chrono::milliseconds(300));
  const Handling now = desk.Now();
  EXPECT_NEAR(now.pressure_mpa.value(), 0.3e-3, 0.01e-3) << "at its highest rate, 1 kPa/s";
  EXPECT_NEAR(now.pressure_mpaps, 1e-3, 0.01e-3);
  const auto refused = desk.SetPressure(0.0005);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_TRUE(desk.SetPressure(std::nullopt).ok()) << "as 'poke --release' does for all links";
  EXPECT_TRUE(desk.Now().pressure_mpa.has_value());
}

}  // namespace
}  // namespace taclink::server

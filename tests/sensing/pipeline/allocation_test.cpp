#include <gtest/gtest.h>

#include "sensing/pipeline/link_pipeline.h"
#include "tests/support/count_allocations.h"
#include "tests/support/moving_skin.h"

namespace taclink {
namespace {

long CountOf(LinkPipeline& pipeline, const StereoFrame& frame, LinkState& state) {
  const long before = allocations;
  pipeline.Process(frame, state);
  EXPECT_EQ(state.tracking.mode, TrackingMode::kTracked);
  return allocations - before;
}

class AllocationTest : public ::testing::TestWithParam<std::string> {};

// While nothing touches. Solving loads still allocates: its bound is here so that it can't grow unseen.
TEST_P(AllocationTest, TrackedFramesAllocateNothingAtRest) {
  constexpr long kMostTouched = 20000;
  Scene scene;
  scene.skin = SkinKind::kLinear;
  scene.model = GetParam();
  scene.duration_s = 10;
  scene.pressure = {{0, 0}};
  SceneContact contact;
  contact.at = {.angle_rad = 1, .z_mm = 80};
  contact.depth_mm = 6;
  contact.begin_s = 0.5;
  contact.end_s = 8;
  contact.ramp_s = 0.5;
  scene.contacts = {contact};
  MovingSkin skin(GetParam(), scene);
  PipelineOptions options;
  options.rest_frames = 2;
  options.rig = skin.model.nominal_rig;
  LinkPipeline pipeline(skin.model, options);
  LinkState state;
  uint64_t sequence = 0;
  for (int k = 0; k < 6; ++k) pipeline.Process(skin.Take(0, sequence++), state);
  ASSERT_EQ(state.status, LinkStatus::kOk) << state.status_reason;
  ASSERT_GT(allocations, 0);
  for (int k = 0; k < 10; ++k)
    EXPECT_EQ(CountOf(pipeline, skin.Take(0, sequence++), state), 0) << "at rest " << k;
  for (double t = 0.5; t < 1.3; t += 1 / 30.0) pipeline.Process(skin.Take(t, sequence++), state);
  ASSERT_FALSE(state.contacts.empty());
  for (int k = 0; k < 10; ++k) {
    EXPECT_LT(CountOf(pipeline, skin.Take(1.3 + 0.01 * k, sequence++), state), kMostTouched)
        << "touched " << k;
    EXPECT_FALSE(state.contacts.empty());
  }
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, AllocationTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink

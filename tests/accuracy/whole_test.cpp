// The whole way from pictures to forces, with default settings, when something goes wrong: a part of `taclink
// bench whole`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "bench/whole/whole_bench.h"
#include "bench/whole/whole_report.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

// What it must be named by, where it must be, and after how long.
struct Expected {
  double least_right = 0;  // share of the frames
  bool is_named = false;
  int most_silent = 0;
};

std::map<std::string, Expected> Kinds() {
  return {{"touched, 0.5 kPa", {.least_right = 0.98}},
          {"touched, 1 kPa", {.least_right = 0.98}},
          {"no pressure source, 1.0 kPa", {.least_right = 0.95}},
          {"pressure ramp while touched", {.least_right = 0.95}},
          {"slide, 0.8 kPa", {.least_right = 0.95}},
          {"baseline under 1.0 kPa", {.least_right = 0.95}},
          {"started while touched, 1 kPa, calibrated", {.least_right = 0.95}},
          {"demo, swing_lower", {.least_right = 0.98}},
          {"swinging", {.least_right = 0.98}},
          {"swinging, 1 kPa", {.least_right = 0.98}},
          {"rolling, 0.5 kPa", {.least_right = 0.98}},
          {"swinging, mounted 20 deg off about x", {.least_right = 0.9, .is_named = true}},
          {"both frozen, encoded again", {.least_right = 0, .is_named = true}},
          {"top at half the rate", {.least_right = 0.95, .is_named = true}},
          {"swapped", {.least_right = 0, .is_named = true}},
          {"top mirrored", {.least_right = 0, .is_named = true}},
          {"three markers gone", {.least_right = 0.95}},
          {"a strip of two paths gone, always", {.least_right = 0.95}},
          {"top frozen", {.least_right = 0.9, .is_named = true}},
          {"both frozen", {.least_right = 0, .is_named = true}},
          // Until the skin has moved by a tenth of a millimeter or two, no one can know.
          {"top 0.2 s late", {.least_right = 0, .is_named = true, .most_silent = 3}},
          {"top shifted by 3 px", {.least_right = 0, .is_named = true}},
          {"bottom moved by 0.3 mm", {.least_right = 0, .is_named = true}},
          {"both lamps out", {.least_right = 0, .is_named = true}}};
}

TEST(WholeTest, NothingIsSilentlyWrong) {
  const std::vector<LinkModel> models = {LoadLinkModel("cylinder").value(), LoadLinkModel("barrel").value()};
  const std::map<std::string, Expected> kinds = Kinds();
  std::vector<WholeScene> scenes = WholeScenes(models.front());
  std::erase_if(scenes, [&](const WholeScene& scene) { return !kinds.contains(scene.kind); });
  ASSERT_EQ(scenes.size(), kinds.size());
  for (const WholeOutcome& outcome : RunWholeBench(models, scenes, {.jobs = 2})) {
    const Expected& expected = kinds.at(outcome.scene->kind);
    const WholeSummary sum = Summarize({&outcome});
    SCOPED_TRACE(outcome.scene->kind);
    ASSERT_EQ(outcome.failure, "");
    EXPECT_GT(sum.frames, 50);
    EXPECT_LE(sum.silent, expected.most_silent);
    EXPECT_GE(sum.right, expected.least_right * sum.frames);
    if (expected.is_named) {
      EXPECT_EQ(sum.named, 1);
      EXPECT_LT(sum.named_after_s, 2);
    }
  }
}

}  // namespace
}  // namespace taclink

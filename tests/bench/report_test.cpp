#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bench/vision/vision_report.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

std::vector<SceneOutcome> TwoScenes() {
  std::vector<SceneOutcome> outcomes;
  for (const double error : {3.0, 4.0}) {
    VisionScore score;
    score.frames = score.measured = 1;
    score.position[2].Add(Vec3(0, 0, error), Vec3(30, 0, 50));
    score.labels[0] = {.visible = 10, .labelled = 9, .wrong = 2, .stray = 0, .missing = 1};
    score.times.Add({.decode = 1, .detect = 0.5, .register_ = 0.25, .reconstruct = 0.25, .force = 3});
    outcomes.push_back({"rest-can-1", SceneCategory::kRest, "can", 11, {score}, {{}}});
  }
  return outcomes;
}

const std::vector<VisionMethodKind> kMethods = {{"ours", "", nullptr}};

TEST(VisionReport, SumsScenes) {
  const VisionScore sum = SumScores(TwoScenes(), 0);
  EXPECT_NEAR(sum.position[2].Rms(ErrorAxis::kZ), std::sqrt(12.5), 1e-12);
  EXPECT_EQ(sum.position[2].Worst(ErrorAxis::k3d), 4);
  EXPECT_EQ(sum.labels[0].wrong, 4);
  EXPECT_NEAR(Percentile(sum.times.vision, 0.5), 1, 1e-6);
  EXPECT_NEAR(Percentile(sum.times.whole, 0.5), 5, 1e-6);
}

TEST(VisionReport, TablesHoldTheNumbersAsTextAndMarkdown) {
  const auto tables = VisionTables(TwoScenes(), kMethods);
  ASSERT_FALSE(tables.empty());
  const std::string text = AlignedText(tables[0]), markdown = Markdown(tables[0]);
  for (const std::string& shown : {text, markdown}) {
    EXPECT_THAT(shown, HasSubstr("3.536"));
    EXPECT_THAT(shown, HasSubstr("10.00 %"));  // missing
  }
  EXPECT_THAT(markdown, HasSubstr("|---"));
  for (const ReportTable& table : tables) {
    for (const auto& row : table.rows) EXPECT_EQ(row.size(), table.header.size()) << table.title;
  }
}

TEST(VisionReport, PlotNamesAxesAndMethods) {
  const std::string svg = ErrorTimePlot(TwoScenes(), kMethods);
  EXPECT_THAT(svg, ::testing::StartsWith("<svg"));
  EXPECT_THAT(svg, HasSubstr("ours, can"));
  EXPECT_THAT(svg, HasSubstr("ms<"));
  EXPECT_THAT(svg, HasSubstr("mm<"));
  EXPECT_THAT(svg, ::testing::EndsWith("</svg>\n"));
  EXPECT_THAT(ErrorTimePlot({}, kMethods), HasSubstr("nothing was measured"));
}

}  // namespace
}  // namespace taclink

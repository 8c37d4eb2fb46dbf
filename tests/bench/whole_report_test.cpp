#include "bench/whole/whole_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class WholeReportTest : public ::testing::Test {
 protected:
  WholeReportTest() { scene_.model = "cylinder"; }

  // Of two frames: the first without forces where `refused`.
  WholeOutcome Outcome(const ForceMethod& method, double off_n, double cpu_ms, bool refused = false) const {
    WholeFrame frame;
    frame.status = LinkStatus::kOk;
    frame.has_forces = true;
    frame.is_right = off_n < 0.1;
    frame.bodies = 1;
    frame.true_n = 0.5;
    frame.off_n = off_n;
    frame.cpu_ms = cpu_ms;
    WholeFrame first = frame;
    if (refused) {
      first.status = LinkStatus::kDegraded;
      first.has_forces = false;
      first.off_n = 0.5;
    }
    return {.scene = &scene_, .method = method, .frames = {first, frame}, .refusal = {}, .failure = {}};
  }

  WholeScene scene_;
};

TEST_F(WholeReportTest, MethodsAreComparedByWhatTheyAnswer) {
  const ForceMethod coarse{ForceModel::kNonlinear, 1}, usual{};
  const auto table =
      WholeMethodTable({Outcome(coarse, 0.1, 2), Outcome(usual, 0.01, 8, true), Outcome(coarse, 0.2, 4)});
  ASSERT_EQ(table.rows.size(), 2u);
  EXPECT_THAT(table.rows[0], ElementsAre("nonlinear", "1", "cylinder", "4", "100.0 %", "0.0 %", "0.0 %", "0",
                                         "30.0 %", "3.0", "4.0", "4.0", "4"));
  EXPECT_THAT(table.rows[1], ElementsAre("auto", "default", "cylinder", "2", "50.0 %", "50.0 %", "50.0 %",
                                         "0", "2.0 %", "8.0", "8.0", "8.0", "8"));
}

TEST_F(WholeReportTest, APlotNamesModelMeshAndLink) {
  const std::string svg = WholeMethodPlot({Outcome({ForceModel::kLinear, 2}, 0.1, 2)});
  EXPECT_THAT(svg, HasSubstr("linear 2, cylinder"));
}

}  // namespace
}  // namespace taclink

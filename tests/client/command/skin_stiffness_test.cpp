// taclink skin stiffness, against taclink skin push and arithmetic.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "client/command/offline/curve_plot.h"
#include "tests/client/command/log_content.h"
#include "tests/support/paths.h"
#include "tests/support/process.h"

namespace taclink::testing {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class SkinStiffnessTest : public LogToolTest {
 protected:
  static Finished Skin(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {kTaclink, "skin"});
    return RunToEnd(arguments);
  }
  static json SkinJson(std::vector<std::string> arguments) {
    arguments.emplace_back("--json");
    const Finished run = Skin(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out, nullptr, false);
  }
  std::string Written(const std::string& name, const std::string& text) const {
    std::ofstream(Path(name)) << text;
    return Path(name);
  }
  static std::string Read(const std::string& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
};

TEST_F(SkinStiffnessTest, IsOfEveryRingAndPressure) {
  const json report =
      SkinJson({"stiffness", "--model", "third", "--pressures", "0,1", "--depth-mm", "2", "--refinement", "1",
                "--patch-diameter-mm", "2", "--csv", Path("out.csv"), "--svg", Path("out.svg")});
  EXPECT_TRUE(report.at("one_path_by_symmetry").get<bool>());
  ASSERT_EQ(report.at("rows").size(), 20u);
  for (size_t ring = 0; ring < 10; ++ring) {
    const json &slack = report.at("rows")[ring], &inflated = report.at("rows")[10 + ring];
    EXPECT_EQ(inflated.at("ring"), ring + 1);
    EXPECT_EQ(inflated.at("pressure_kpa"), 1);
    // Tension stiffens a skin.
    EXPECT_GT(inflated.at("secant_n_per_mm").get<double>(), slack.at("secant_n_per_mm").get<double>());
    EXPECT_DOUBLE_EQ(slack.at("secant_n_per_mm").get<double>(), slack.at("force_n").get<double>() / 2);
  }
  const json push = SkinJson({"push", "--model", "third", "--node", "3,4", "--depth-mm", "2", "--refinement",
                              "1", "--patch-diameter-mm", "2"});
  EXPECT_NEAR(report.at("rows")[3].at("force_n").get<double>(), push.at("force_n").get<double>(), 1e-4);
  EXPECT_THAT(Read(Path("out.csv")), HasSubstr("path,ring,z_mm,pressure_kpa,inflation_mm,depth_mm,force_n,"));
  EXPECT_THAT(Read(Path("out.svg")), HasSubstr("path 1, ring 10"));
}

// What can't be computed says why, and leaves the rest.
TEST_F(SkinStiffnessTest, SaysWhereThereIsNone) {
  const json report = SkinJson({"stiffness", "--model", "third", "--pressures", "0,-3", "--depth-mm", "1",
                                "--refinement", "1", "--places", "2,5"});
  ASSERT_EQ(report.at("rows").size(), 2u);
  EXPECT_TRUE(report.at("rows")[0].contains("force_n"));
  const Finished beyond =
      Skin({"stiffness", "--model", "third", "--pressures", "0", "--depth-mm", "8", "--refinement", "1"});
  EXPECT_EQ(beyond.exit_code, 1);
  EXPECT_THAT(beyond.err, HasSubstr("goes into the tube"));
  for (const std::string place : {"25,1", "0,1", "1", "1,11", "x"}) {
    const Finished run = Skin({"stiffness", "--model", "third", "--places", place});
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.err, HasSubstr("is not a place PATH,RING"));
  }
}

TEST_F(SkinStiffnessTest, ComparesWithMeasuredForces) {
  const std::string csv = Written("probe.csv",
                                  "# by hand\nj,depth_mm,pressure_kpa,force_n\n"
                                  "5,5,0,0.1\n5,5,1,0.7\n5,10,1,0.9\n8,5,1,0\n");
  const json report = SkinJson({"stiffness", "--model", "cylinder", "--refinement", "1", "--compare", csv});
  ASSERT_EQ(report.at("rows").size(), 4u);
  const json push = SkinJson({"push", "--model", "cylinder", "--node", "7,5", "--depth-mm", "5",
                              "--pressure-kpa", "1", "--refinement", "1"});
  const auto computed = [&](size_t row) { return report.at("rows")[row].at("computed_n").get<double>(); };
  EXPECT_NEAR(computed(1), push.at("force_n").get<double>(), 1e-4);
  EXPECT_NEAR(report.at("rows")[1].at("error_percent").get<double>(), 100 * (computed(1) / 0.7 - 1), 1e-6);
  EXPECT_TRUE(report.at("rows")[3].at("error_percent").is_null()) << "no share of nothing";
  EXPECT_EQ(report.at("rows_under_pressure"), 2);
  EXPECT_NEAR(report.at("mean_absolute_error_percent").get<double>(),
              50 * (std::abs(computed(1) / 0.7 - 1) + std::abs(computed(2) / 0.9 - 1)), 1e-6);

  const Finished no_pressure =
      Skin({"stiffness", "--model", "cylinder", "--refinement", "1", "--compare",
            Written("slack.csv", "ring,depth_mm,pressure_kpa,force_n\n5,5,0,0.1\n")});
  EXPECT_THAT(no_pressure.out, HasSubstr("no row is under pressure"));
  EXPECT_EQ(Skin({"stiffness", "--model", "cylinder", "--compare", csv, "--places", "1,1"}).exit_code, 2);
}

// Curves over the same axes: a point that is not finite breaks one.
TEST_F(SkinStiffnessTest, PlotsCurvesWithGaps) {
  using command::CurvePanel;
  using command::PlotCurve;
  const PlotCurve curve{.name = "a<b", .colour = "red", .x = {0, 1, 2, 3}, .y = {0, 2, NAN, 4}};
  const std::string svg = command::CurvePlot("title", {CurvePanel{"x", "y", {curve}}});
  EXPECT_THAT(svg, HasSubstr(">a&lt;b<"));
  const size_t path = svg.find("class=\"curve\" d=\"");
  ASSERT_NE(path, std::string::npos);
  const std::string d = svg.substr(path + 17, svg.find('"', path + 17) - path - 17);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'M'), 2);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'L'), 1);
  EXPECT_THAT(command::CurvePlot("title", {CurvePanel{"x", "y", {}}}), HasSubstr("nothing was computed"));
}

}  // namespace
}  // namespace taclink::testing

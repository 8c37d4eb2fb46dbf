// taclink skin check: what it prints and writes, and how it ends. What it finds: tests/sensing/design.
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "sensing/model/model_file.h"
#include "tests/client/command/log_content.h"
#include "tests/support/paths.h"
#include "tests/support/process.h"

namespace taclink::testing {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

class SkinCheckCommandTest : public LogToolTest {
 protected:
  static Finished CheckSkin(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {kTaclink, "skin", "check"});
    return RunToEnd(arguments);
  }
  std::string ReadFile(const std::string& name) const {
    std::ifstream file(Path(name));
    return {std::istreambuf_iterator<char>(file), {}};
  }
};

TEST_F(SkinCheckCommandTest, AGoodDesignEndsWithZero) {
  const Finished run =
      CheckSkin({"--model", "cylinder", "--json", "--html", Path("page.html"), "--svg-dir", Path("maps")});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const json report = json::parse(run.out, nullptr, false);
  EXPECT_EQ(report.at("faults"), 0);
  EXPECT_EQ(report.at("slack").at("rings").size(), 10u);
  EXPECT_EQ(report.at("loaded").at("markers").size(), 240u);
  EXPECT_EQ(report.at("loaded").at("pressure_kpa"), 1.5);
  EXPECT_LT(report.at("pressure_limits").at("buckles_kpa").get<double>(), 0);
  EXPECT_TRUE(report.at("pressure_limits").at("runs_away_kpa").is_null());
  for (const json& finding : report.at("findings")) EXPECT_NE(finding.at("severity"), "fault") << finding;
  EXPECT_THAT(ReadFile("page.html"), AllOf(HasSubstr("<svg"), HasSubstr("least detectable force, slack")));
  EXPECT_THAT(ReadFile("maps/loaded_sigma_Z.svg"), HasSubstr("path 24, ring 10: "));
}

TEST_F(SkinCheckCommandTest, AFaultEndsWithOne) {
  std::string text(ShippedModelText("third"));
  const std::string from = "diameter_mm: 0.95";
  text.replace(text.find(from), from.size(), "diameter_mm: 0.5");
  std::ofstream(Path("small.yaml")) << text;
  const Finished run = CheckSkin({"--model", Path("small.yaml"), "--pressure-kpa", "0.5"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.out, AllOf(HasSubstr("fault    marker_too_small: "),
                             HasSubstr("change: a marker diameter of at least"), HasSubstr("at 0.5 kPa")));
  EXPECT_THAT(run.err, HasSubstr("has "));
  EXPECT_EQ(CheckSkin({"--model", "third", "--pressure-kpa", "-1"}).exit_code, 2);
  EXPECT_THAT(CheckSkin({"--model", "nothing"}).err, HasSubstr("neither a file nor a shipped model"));
}

}  // namespace
}  // namespace taclink::testing

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "sensing/model/model_file.h"
#include "tests/accuracy/probe.h"
#include "tests/support/paths.h"
#include "tests/support/process.h"

namespace taclink {
namespace {

// Forces of a 5.5 mm flat probe on a real TacLINK at path 7 (tests/data/probe_forces.csv names the source),
// by the command that designers use.
TEST(ProbeForce, OfTheShippedSkinIsTheRealOnes) {
  const testing::Finished run =
      testing::RunToEnd({testing::kTaclink, "skin", "stiffness", "--model", "cylinder", "--compare",
                         testing::TestData("probe_forces.csv"), "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto report = nlohmann::json::parse(run.out);
  ASSERT_EQ(report.at("rows").size(), 16u);
  double sum = 0;
  int under_pressure = 0;
  for (const auto& row : report.at("rows")) {
    if (row.at("pressure_kpa").get<double>() == 0) continue;
    const double error = row.at("computed_n").get<double>() / row.at("measured_n").get<double>() - 1;
    EXPECT_LT(std::abs(error), 0.08) << row;
    sum += std::abs(error);
    ++under_pressure;
  }
  ASSERT_EQ(under_pressure, 12);
  std::printf("mean error of the shipped skin: %.2f %%\n", 100 * sum / under_pressure);
  EXPECT_LE(sum / under_pressure, 0.04);
  EXPECT_NEAR(report.at("mean_absolute_error_percent").get<double>(), 100 * sum / under_pressure, 1e-6);
}

// The real skin grew by about 4.5 mm at 1.5 kPa (thesis, 5.9).
TEST(ProbeForce, TheShippedSkinGrowsAsTheRealOne) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  EXPECT_NEAR(Pushed(model, 5, -3, 1.5).inflation_mm, 4.5, 0.9);
}

}  // namespace
}  // namespace taclink

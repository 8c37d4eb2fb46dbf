#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "sensing/model/model_file.h"
#include "tests/accuracy/probe.h"
#include "tests/support/paths.h"

namespace taclink {
namespace {

// A row of calculix/results.csv: three-dimensional bricks, solved by another program
// (docs/reports/calculix.md).
struct Judged {
  std::string name, law, quantity;
  double pressure_kpa = 0, depth_mm = 0, value = 0;
};

std::vector<Judged> Judgements() {
  std::ifstream file(testing::CalculixData("results.csv"));
  std::vector<Judged> all;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream in(line);
    std::vector<std::string> cells;
    for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
    if (cells.size() < 9) continue;
    all.push_back(
        {cells[0], cells[1], cells[6], std::stod(cells[4]), std::stod(cells[5]), std::stod(cells[7])});
  }
  return all;
}

LinkModel SkinOf(const std::string& law) {
  LinkModel model = LoadLinkModel("cylinder").value();
  const bool rubber = law == "neo-hookean";
  model.material = {.youngs_modulus_mpa = 0.1,
                    .poisson_ratio = rubber ? 0.5 : 0.49,
                    .law = rubber ? MaterialLaw::kNeoHookean : MaterialLaw::kSaintVenantKirchhoff};
  return model;
}

TEST(CalculiX, PushesNeedTheSameForce) {
  int compared = 0;
  for (const Judged& judged : Judgements()) {
    if (judged.quantity != "probe_force" || (judged.name != "push-j5" && judged.name != "push-j8")) continue;
    const int ring = judged.name == "push-j5" ? 5 : 8;
    const double force_n = Pushed(SkinOf(judged.law), ring, judged.depth_mm, judged.pressure_kpa).force_n;
    EXPECT_NEAR(force_n / judged.value, 1, 0.045)
        << judged.name << " " << judged.law << " " << judged.depth_mm << " mm " << judged.pressure_kpa
        << " kPa";
    std::printf("%s %s %g mm %g kPa: bricks %.4f N, shell %.4f N\n", judged.name.c_str(), judged.law.c_str(),
                judged.depth_mm, judged.pressure_kpa, judged.value, force_n);
    ++compared;
  }
  EXPECT_GE(compared, 16);
}

TEST(CalculiX, InflationIsTheSame) {
  int compared = 0;
  for (const Judged& judged : Judgements()) {
    if (judged.name != "tube-inflation" || judged.quantity != "radial_middle:middle") continue;
    const double inflation_mm = Pushed(SkinOf(judged.law), 5, -9, judged.pressure_kpa).inflation_mm;
    // 1 % of it is the bricks' nu = 0.49 (docs/reports/calculix.md).
    EXPECT_NEAR(inflation_mm / judged.value, 1, 0.02) << judged.law << " " << judged.pressure_kpa << " kPa";
    std::printf("inflation %s %g kPa: bricks %.3f mm, shell %.3f mm\n", judged.law.c_str(),
                judged.pressure_kpa, judged.value, inflation_mm);
    ++compared;
  }
  EXPECT_GE(compared, 6);
}

}  // namespace
}  // namespace taclink

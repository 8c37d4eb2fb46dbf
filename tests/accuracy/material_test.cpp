// Young's modulus from truth that the fit's own shell did not make, or made on another mesh.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <random>
#include <sstream>

#include "sensing/identification/material_fit.h"
#include "sensing/model/model_file.h"
#include "tests/support/inflated_skin.h"
#include "tests/support/paths.h"

namespace taclink {
namespace {

constexpr auto kSvk = MaterialLaw::kSaintVenantKirchhoff, kRubber = MaterialLaw::kNeoHookean;

class MaterialOf : public ::testing::TestWithParam<MaterialLaw> {
 protected:
  static void Print(const char* what, const MaterialFit& fit) {
    std::printf("%s, %s: %.4f +- %.4f MPa", what, Name(fit.material.law), fit.material.youngs_modulus_mpa,
                fit.sigma_mpa);
    for (const auto& [name, kind] : {std::pair("inflation", fit.inflation), std::pair("forces", fit.probe)}) {
      if (kind)
        std::printf("; %s %.4f +- %.4f, residuals %.1f %%", name, kind->youngs_modulus_mpa, kind->sigma_mpa,
                    100 * kind->misfit);
    }
    std::printf("\n");
  }
  // Radial growth alone is known of these rings, on every path.
  InflationRecord Radial(double pressure_kpa, const std::map<int, double>& growth_by_ring) const {
    InflationRecord record{.name = std::to_string(pressure_kpa) + " kPa",
                           .pressure_mpa = pressure_kpa * 1e-3};
    record.markers.resize(static_cast<size_t>(model_.markers.count()));
    for (const auto& [ring, growth] : growth_by_ring) {
      for (int path = 0; path < model_.markers.paths; ++path) {
        const Vec3 out(std::cos(model_.PathAngle(path)), std::sin(model_.PathAngle(path)), 0);
        record.markers[static_cast<size_t>(model_.MarkerIndex(path, ring))] = {growth * out,
                                                                               400 * out * out.transpose()};
      }
    }
    return record;
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
};

std::string Named(const ::testing::TestParamInfo<MaterialLaw>& law) {
  return law.param == kRubber ? "NeoHookean" : "SaintVenantKirchhoff";
}

// Errors of the rest shape are in all records alike.
TEST_P(MaterialOf, AnotherMeshComesOutWithinItsStandardDeviation) {
  constexpr double kModulus = 0.13, kSigma = 0.1;
  constexpr double kPressures[] = {0.7e-3, 1.1e-3, 1.5e-3};
  std::vector<std::vector<Vec3>> exact;
  for (const double p : kPressures)
    exact.push_back(InflatedMarkers(model_, {kModulus, 0.5, GetParam()}, p, 4));
  double squares = 0;
  constexpr int kSeeds = 5;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    const std::vector<Vec3> still(exact[0].size(), Vec3::Zero());
    const auto rest = NoisyRecord(still, 0, kSigma * std::sqrt(0.5), random).markers;
    std::vector<InflationRecord> records;
    for (size_t i = 0; i < exact.size(); ++i) {
      InflationRecord record = NoisyRecord(exact[i], kPressures[i], kSigma * std::sqrt(0.5), random);
      for (size_t m = 0; m < rest.size(); ++m) {
        record.markers[m].displacement_mm -= rest[m].displacement_mm;
        record.markers[m].information_per_mm2 /= 2;
      }
      records.push_back(std::move(record));
    }
    const auto fit = FitMaterial(model_, GetParam(), records, {});
    ASSERT_TRUE(fit.ok()) << fit.error().message;
    Print("another mesh", *fit);
    const double off = (fit->material.youngs_modulus_mpa - kModulus) / fit->sigma_mpa;
    EXPECT_LT(std::abs(off), 3) << "seed " << seed;
    squares += off * off;
  }
  // A standard deviation that is far too large would not be honest either.
  EXPECT_GT(squares / kSeeds, 0.05);
  EXPECT_LT(squares / kSeeds, 3);
}

// Radial growth of the inner wall in calculix/results.csv, at a pressure; at 1 kPa along z.
std::vector<std::pair<double, double>> GrowthAlong(const std::string& law, double pressure_kpa) {
  std::ifstream file(testing::CalculixData("results.csv"));
  std::vector<std::pair<double, double>> all;
  for (std::string line; std::getline(file, line);) {
    std::istringstream in(line);
    std::vector<std::string> cells;
    for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
    if (cells[0] != "tube-inflation" || cells[1] != law || std::stod(cells[4]) != pressure_kpa) continue;
    const std::string along = "radial_inner:z=";
    if (cells[6] == "radial_inner:middle") all.emplace_back(99, std::stod(cells[7]));
    if (cells[6].rfind(along, 0) == 0)
      all.emplace_back(std::stod(cells[6].substr(along.size())), std::stod(cells[7]));
  }
  return all;
}

double At(const std::vector<std::pair<double, double>>& points, double z) {
  for (size_t i = 1; i < points.size(); ++i) {
    const auto& [z0, u0] = points[i - 1];
    const auto& [z1, u1] = points[i];
    if (z <= z1) return u0 + (u1 - u0) * (z - z0) / (z1 - z0);
  }
  return points.back().second;
}

// Three-dimensional bricks of 0.1 MPa and nu = 0.49, whose inner wall, where the markers are, grows by 1 %
// more than an incompressible one's; the St. Venant-Kirchhoff solid is softened by compression through the
// wall as well, which a plane-stress shell of that law does not know.
TEST_P(MaterialOf, BricksOfCalculiX) {
  const std::string law = GetParam() == kRubber ? "neo-hookean" : "st-venant-kirchhoff";
  std::vector<InflationRecord> records;
  for (const double kpa : {0.5, 1.0, 1.5}) {
    const auto along = GrowthAlong(law, kpa);
    ASSERT_FALSE(along.empty()) << law << " " << kpa;
    std::map<int, double> growth;
    for (int ring = 0; ring < model_.markers.rings(); ++ring) {
      const double z = model_.markers.rings_z_mm[static_cast<size_t>(ring)];
      const double from_end = std::min(z, model_.length_mm - z);
      if (along.size() > 1 || from_end > 80) growth[ring] = At(along, from_end);
    }
    records.push_back(Radial(kpa, growth));
  }
  const auto fit = FitMaterial(model_, GetParam(), records, {});
  ASSERT_TRUE(fit.ok()) << fit.error().message;
  Print("bricks", *fit);
  EXPECT_NEAR(fit->material.youngs_modulus_mpa, 0.1, GetParam() == kRubber ? 0.002 : 0.004);
  EXPECT_LT(fit->misfit, 0.02);
}

// The real TacLINK: twelve probe forces under pressure, published with the prototype, and 4.5 mm of growth in
// the middle at 1.5 kPa (thesis, 5.9). What the shipped cylinder's material comes from. (Its four forces
// without pressure are three to five steps of the load cell and only blur this.)
TEST_P(MaterialOf, TheRealSkin) {
  constexpr double kForces[] = {0.3729, 0.6217, 0.9012, 0.5904, 1.0254, 1.3984,
                                0.4038, 0.6831, 0.9626, 0.6528, 1.0564, 1.4599};
  std::vector<ProbeRecord> probes;
  for (const int ring : {4, 7}) {
    for (const double depth_mm : {5, 10}) {
      for (const double kpa : {0.5, 1.0, 1.5}) {
        probes.push_back({.name = "row " + std::to_string(probes.size() + 1),
                          .ring = ring,
                          .depth_mm = depth_mm,
                          .pressure_mpa = kpa * 1e-3,
                          .force_n = kForces[probes.size()]});
      }
    }
  }
  const InflationRecord inflation = Radial(1.5, {{4, 4.5}, {5, 4.5}});
  const auto fit = FitMaterial(model_, GetParam(), {&inflation, 1}, probes);
  ASSERT_TRUE(fit.ok()) << fit.error().message;
  Print("real skin", *fit);
  double error = 0;
  for (const ProbeFit& one : fit->probes) {
    std::printf("  %s: measured %.3f N, model %.3f N\n", one.name.c_str(), one.measured_n, one.model_n);
    error += std::abs(one.model_n / one.measured_n - 1) / static_cast<double>(fit->probes.size());
  }
  std::printf("  mean error %.2f %%, tension %.1f\n", 100 * error, fit->tension);
  // Inflation wants a stiffer skin than the forces with both laws, but with this one by no more than a probe
  // differs from day to day (10 to 27 %), and one modulus does both.
  const double apart = fit->inflation->youngs_modulus_mpa / fit->probe->youngs_modulus_mpa - 1;
  if (GetParam() == kSvk) {
    EXPECT_LT(std::abs(apart), 0.13);
    EXPECT_LT(fit->misfit, 0.055);
    EXPECT_LT(error, 0.04);
    EXPECT_NEAR(fit->material.youngs_modulus_mpa, model_.material.youngs_modulus_mpa, 3e-4);
    EXPECT_NEAR(fit->sigma_mpa, model_.material_evidence->sigma_mpa, 3e-4);
  } else {
    EXPECT_GT(apart, 0.2);
    EXPECT_GT(fit->misfit, 0.08);
    EXPECT_GT(error, 0.05);
  }
  const KindFit& forces = *fit->probe;
  EXPECT_NEAR(forces.youngs_modulus_mpa, 0.1, 0.02);
  EXPECT_LT(forces.sigma_mpa, 0.012);
  EXPECT_GT(forces.sigma_mpa, 0.001);
}

INSTANTIATE_TEST_SUITE_P(Laws, MaterialOf, ::testing::Values(kSvk, kRubber), Named);

}  // namespace
}  // namespace taclink

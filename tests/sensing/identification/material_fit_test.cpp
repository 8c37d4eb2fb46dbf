#include "sensing/identification/material_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "sensing/model/model_file.h"
#include "sensing/shell/skin_response.h"
#include "tests/support/drawn_vector.h"
#include "tests/support/inflated_skin.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

constexpr auto kSvk = MaterialLaw::kSaintVenantKirchhoff, kRubber = MaterialLaw::kNeoHookean;

class MaterialFitTest : public ::testing::Test {
 protected:
  // An SVK skin that is three times as stiff as the model says.
  static constexpr double kModulus = 0.3;
  static constexpr double kPressures[] = {2e-3, 4e-3};

  static void SetUpTestSuite() {
    const LinkModel model = LoadLinkModel("cylinder").value();
    for (const double pressure : kPressures)
      Inflated().push_back(InflatedMarkers(model, {kModulus, 0.5, kSvk}, pressure, 3));
  }
  static void TearDownTestSuite() { Inflated().clear(); }
  static std::vector<std::vector<Vec3>>& Inflated() {
    static std::vector<std::vector<Vec3>> inflated;
    return inflated;
  }

  std::vector<InflationRecord> Records(double sigma_mm = 0.05) {
    std::vector<InflationRecord> records;
    for (size_t i = 0; i < std::size(kPressures); ++i)
      records.push_back(NoisyRecord(Inflated()[i], kPressures[i], sigma_mm, random_));
    return records;
  }

  Result<MaterialFit> Fit(const std::vector<InflationRecord>& records,
                          const std::vector<ProbeRecord>& probes = {}) {
    return FitMaterial(model_, kSvk, records, probes, {.refinement = 2});
  }
  std::string Refusal(const std::vector<InflationRecord>& records,
                      const std::vector<ProbeRecord>& probes = {}) {
    const auto fit = Fit(records, probes);
    return fit.ok() ? "accepted" : fit.error().message;
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  std::mt19937 random_{7};
};

TEST_F(MaterialFitTest, FindsTheModulusDespiteWrongLabels) {
  auto records = Records();
  std::normal_distribution<double> normal(0, 8);
  for (int m = 3; m < model_.markers.count(); m += 19) {
    for (InflationRecord& record : records)
      record.markers[static_cast<size_t>(m)].displacement_mm += DrawnVec3([&] { return normal(random_); });
  }
  const auto fit = Fit(records);
  ASSERT_TRUE(fit.ok()) << fit.error().message;
  EXPECT_NEAR(fit->material.youngs_modulus_mpa, kModulus, 0.005 * kModulus);
  EXPECT_LT(fit->sigma_mpa, 0.005 * kModulus);
  EXPECT_EQ(fit->material.law, kSvk);
  ASSERT_EQ(fit->inflations.size(), 2u);
  for (const InflationFit& one : fit->inflations) {
    EXPECT_NEAR(one.outliers, 13, 2) << one.name;
    EXPECT_EQ(one.used + one.outliers, 240);
    EXPECT_NEAR(one.rmse_mm, 0.05 * std::sqrt(11), 0.02);
    EXPECT_NEAR(one.youngs_modulus_mpa, kModulus, 4 * one.sigma_mpa + 0.003 * kModulus);
  }
  EXPECT_FALSE(fit->probe.has_value());
}

// Twice the noise: twice the standard deviation, whatever was stated.
TEST_F(MaterialFitTest, StandardDeviationFollowsTheScatterNotTheStatement) {
  auto records = Records(0.2);
  const auto fit = Fit(records);
  for (InflationRecord& record : records) {
    for (MeasuredDisplacement& marker : record.markers) marker.information_per_mm2 *= 100;
  }
  const auto boasting = Fit(records);
  ASSERT_TRUE(fit.ok() && boasting.ok());
  EXPECT_NEAR(boasting->sigma_mpa, fit->sigma_mpa, 0.05 * fit->sigma_mpa);
  EXPECT_NEAR(boasting->inflation->chi2 / fit->inflation->chi2, 100, 5);
}

// The wrong law fits each pressure with another modulus, which the standard deviation must tell.
TEST_F(MaterialFitTest, WrongLawIsLessSureAndFitsWorse) {
  const auto records = Records();
  const auto right = Fit(records);
  const auto wrong = FitMaterial(model_, kRubber, records, {}, {.refinement = 2});
  ASSERT_TRUE(right.ok() && wrong.ok());
  EXPECT_GT(wrong->misfit, 1.5 * right->misfit);
  EXPECT_GT(wrong->sigma_mpa, 10 * right->sigma_mpa);
  EXPECT_EQ(wrong->material.poisson_ratio, 0.5);
}

TEST_F(MaterialFitTest, NoPressureIsRefused) {
  EXPECT_THAT(Refusal({}), HasSubstr("no record"));
  auto records = Records();
  for (InflationRecord& record : records) record.pressure_mpa = 0;
  EXPECT_THAT(Refusal(records), HasSubstr("all inflation pressures are 0"));
  records[0].pressure_mpa = -1e-3;
  EXPECT_THAT(Refusal(records), HasSubstr("from 0 to 20 kPa"));
  records[0].pressure_mpa = std::nan("");
  EXPECT_THAT(Refusal(records), HasSubstr("from 0 to 20 kPa"));
}

TEST_F(MaterialFitTest, BadMarkersAreRefused) {
  auto records = Records();
  for (size_t m = 9; m < records[1].markers.size(); ++m) records[1].markers[m].information_per_mm2.setZero();
  EXPECT_THAT(Refusal(records), HasSubstr("only 9 markers"));
  records = Records();
  records[0].markers[3].displacement_mm.y() = std::nan("");
  EXPECT_THAT(Refusal(records), HasSubstr("no number"));
  records[0].markers.pop_back();
  EXPECT_THAT(Refusal(records), HasSubstr("239 markers, the model has 240"));
}

TEST_F(MaterialFitTest, TouchWhileInflatingIsRefusedAndNamed) {
  auto records = Records();
  for (const int path : {5, 6, 7}) {
    for (const int ring : {3, 4}) {
      const int m = model_.MarkerIndex(path, ring);
      const Vec3 out(std::cos(model_.PathAngle(path)), std::sin(model_.PathAngle(path)), 0);
      records[1].markers[static_cast<size_t>(m)].displacement_mm -= (path == 6 && ring == 3 ? 5 : 3) * out;
    }
  }
  EXPECT_THAT(Refusal(records),
              ::testing::AllOf(HasSubstr("touched near path 7, ring 4"), HasSubstr("6 markers")));
}

TEST_F(MaterialFitTest, WhatIsNoInflationIsRefused) {
  auto records = Records();
  for (InflationRecord& record : records) {
    for (MeasuredDisplacement& marker : record.markers) marker.displacement_mm *= -1;
  }
  EXPECT_THAT(Refusal(records), HasSubstr("don't move outwards"));
  // A skin that only moves along its axis, by turns.
  records = Records();
  for (InflationRecord& record : records) {
    for (int m = 0; m < model_.markers.count(); ++m) {
      record.markers[static_cast<size_t>(m)].displacement_mm.z() += model_.PathOf(m) % 2 == 0 ? 6 : -6;
    }
  }
  EXPECT_THAT(Refusal(records), HasSubstr("of what was measured"));
}

TEST_F(MaterialFitTest, WhatTellsNothingIsRefused) {
  // Noise of 0.5 mm on a growth of some 0.001 mm.
  auto records = Records(0.5);
  for (size_t r = 0; r < records.size(); ++r) {
    records[r].pressure_mpa *= 1e-3;
    for (size_t m = 0; m < records[r].markers.size(); ++m)
      records[r].markers[m].displacement_mm -= 0.999 * Inflated()[r][m];
  }
  EXPECT_THAT(Refusal(records),
              ::testing::AnyOf(HasSubstr("tell nothing"), HasSubstr("don't move outwards")));
}

TEST_F(MaterialFitTest, ModulusOutsideTheRangeIsRefused) {
  auto records = Records(1e-9);
  for (InflationRecord& record : records) {
    for (MeasuredDisplacement& marker : record.markers) marker.displacement_mm *= 1e-7;
  }
  EXPECT_THAT(Refusal(records), HasSubstr("outside 1e-4 to 1e5 MPa"));
  // The skin would have to be so soft that it runs away.
  records = Records();
  for (InflationRecord& record : records) {
    for (MeasuredDisplacement& marker : record.markers) marker.displacement_mm *= 12;
  }
  EXPECT_THAT(Refusal(records), HasSubstr("runs away"));
}

TEST_F(MaterialFitTest, BadProbeRowsAreRefused) {
  const ProbeRecord good{.name = "f:2", .ring = 4, .depth_mm = 5, .pressure_mpa = 0, .force_n = 0.1};
  const auto with = [&](auto change) {
    ProbeRecord bad = good;
    change(bad);
    return Refusal({}, {bad});
  };
  EXPECT_THAT(with([](ProbeRecord& r) { r.ring = 10; }), HasSubstr("f:2: no such ring"));
  EXPECT_THAT(with([](ProbeRecord& r) { r.force_n = 0; }), HasSubstr("f:2: the depth must be finite"));
  EXPECT_THAT(with([](ProbeRecord& r) { r.depth_mm = std::nan(""); }), HasSubstr("f:2"));
  EXPECT_THAT(with([](ProbeRecord& r) { r.pressure_mpa = -1e-4; }), HasSubstr("20 kPa"));
  EXPECT_THAT(with([](ProbeRecord& r) { r.depth_mm = 30; }), HasSubstr("into the tube"));
}

// Interpolated answers against solutions at that very pressure and modulus.
TEST(SkinResponse, IsTheSkinAtAnyModulus) {
  LinkModel model = LoadLinkModel("cylinder").value();
  for (const MaterialLaw law : {kSvk, kRubber}) {
    SkinResponse response(model, law, 2);
    model.material = {7.3, 0.5, law};
    for (const double s : {0.0013, 0.0049, 0.0121}) {
      const auto grown = response.GrowthAt(s);
      ASSERT_TRUE(grown.ok()) << grown.error().message;
      const auto exact = InflatedMarkers(model, model.material, s * 7.3, 2);
      for (int ring = 0; ring < model.markers.rings(); ++ring) {
        const Vec3& u = exact[static_cast<size_t>(model.MarkerIndex(0, ring))];
        const Vec2& is = grown->mm[static_cast<size_t>(ring)];
        EXPECT_NEAR(is.x(), u.x(), 2e-3 * u.x()) << Name(law) << " " << s << " " << ring;
        EXPECT_NEAR(is.y(), u.z(), 2e-3 * u.x()) << Name(law) << " " << s << " " << ring;
      }
    }
  }
}

TEST(SkinResponse, EndsWhereTheSkinRunsAway) {
  SkinResponse response(LoadLinkModel("cylinder").value(), kRubber, 1);
  EXPECT_TRUE(response.GrowthAt(0.015).ok());
  const auto beyond = response.GrowthAt(0.05);
  ASSERT_FALSE(beyond.ok());
  EXPECT_THAT(beyond.error().message, HasSubstr("runs away"));
  EXPECT_FALSE(response.GrowthAt(-0.001).ok());
  EXPECT_FALSE(response.GrowthAt(std::nan("")).ok());
}

}  // namespace
}  // namespace taclink

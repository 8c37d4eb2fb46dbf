#include "sensing/identification/material_evidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Minimise, FindsTheBottomFromFarAway) {
  const auto cost = [](double x) { return std::cosh(x - 3.25); };
  for (const double start : {-4.0, 3.0, 9.0}) {
    const Minimum found = Minimise(cost, start);
    EXPECT_NEAR(found.at, 3.25, 1e-4) << start;
    EXPECT_FALSE(found.at_edge);
  }
}

TEST(Minimise, SaysThatItStandsAtTheEdge) {
  const Minimum found = Minimise([](double x) { return x < 1 ? kInfinity : x * x; }, 2);
  EXPECT_NEAR(found.at, 1, 1e-3);
  EXPECT_TRUE(found.at_edge);
  // Begins where there is nothing.
  EXPECT_NEAR(Minimise([](double x) { return x < 1 ? kInfinity : (x - 2) * (x - 2); }, -1).at, 2, 1e-4);
  EXPECT_TRUE(std::isinf(Minimise([](double) { return kInfinity; }, 0).value));
}

// By hand: 1, 2 and 100 standard deviations among many of about 1.
TEST(OutliersOf, AreFarFromTheirOwnRecord) {
  Observations seen;
  for (int i = 0; i < 30; ++i) {
    seen.push_back(
        {.record = 0, .marker = i, .dims = 3, .measured = Vec3(1, i % 3, 1), .model = Vec3::Zero()});
    // A record ten times worse, all alike.
    seen.push_back(
        {.record = 1, .marker = i, .dims = 3, .measured = Vec3(10, 10, 10 * (i % 3)), .model = Vec3::Zero()});
  }
  seen[14].measured = Vec3(0, 100, 0);
  const std::vector<bool> outliers = OutliersOf(seen);
  for (size_t i = 0; i < outliers.size(); ++i) EXPECT_EQ(outliers[i], i == 14) << i;
}

TEST(OutliersOf, FewAreNotJudged) {
  Observations seen(5, {.marker = -1, .dims = 1, .measured = Vec3::UnitX(), .model = Vec3::Zero()});
  seen[2].measured *= 1000;
  EXPECT_FALSE(OutliersOf(seen)[2]);
}

// One camera: a marker's place along its ray counts for nothing.
TEST(InflationEvidence, RayOfOneCameraIsTwoNumbers) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  InflationRecord record{.name = "one", .pressure_mpa = 1e-3};
  record.markers.resize(static_cast<size_t>(model.markers.count()));
  const Vec3 ray = Vec3(1, 2, 2) / 3;
  record.markers[5] = {100 * ray, 400 * (Mat3::Identity() - ray * ray.transpose())};
  SkinResponse response(model, MaterialLaw::kSaintVenantKirchhoff, 1);
  const auto seen = InflationEvidence(model, response, {&record, 1})(0.1);
  ASSERT_TRUE(seen.ok()) << seen.error().message;
  ASSERT_EQ(seen->size(), 1u);
  EXPECT_EQ((*seen)[0].marker, 5);
  EXPECT_EQ((*seen)[0].dims, 2);
  EXPECT_NEAR((*seen)[0].measured.norm(), 0, 1e-6);
  EXPECT_GT((*seen)[0].model.norm(), 1);
}

// The derivative by ln E against a difference.
TEST(InflationEvidence, DerivativeIsRight) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  InflationRecord record{.name = "one", .pressure_mpa = 1e-3};
  record.markers.assign(static_cast<size_t>(model.markers.count()), {Vec3::Zero(), Mat3::Identity()});
  SkinResponse response(model, MaterialLaw::kNeoHookean, 1);
  const auto evidence = InflationEvidence(model, response, {&record, 1});
  const double h = 1e-4, modulus = 0.1;
  const auto at = evidence(modulus), more = evidence(modulus * std::exp(h)),
             less = evidence(modulus * std::exp(-h));
  ASSERT_TRUE(at.ok() && more.ok() && less.ok());
  for (size_t i = 0; i < at->size(); i += 17) {
    const Vec3 difference = ((*more)[i].model - (*less)[i].model) / (2 * h);
    EXPECT_NEAR(((*at)[i].by_log - difference).norm(), 0, 1e-4 * difference.norm());
    EXPECT_LT((*at)[i].by_log.dot((*at)[i].model), 0);  // stiffer grows less
  }
}

}  // namespace
}  // namespace taclink

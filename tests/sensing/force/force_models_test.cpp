#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "sensing/contact/contact_finder.h"
#include "sensing/force/auto_estimator.h"
#include "sensing/force/compliance_estimator.h"
#include "sensing/force/force_estimator.h"
#include "sensing/mechanics/pressed_skin.h"
#include "sensing/model/model_file.h"
#include "tests/support/drawn_vector.h"

namespace taclink {
namespace {

constexpr double kNoiseMm = 0.05;

// A stamp pressed on the nonlinear skin of a finer mesh than the estimators use.
struct Push {
  Push(const LinkModel& link, double pressure_kpa, double depth_mm, Vec3 drag_mm = Vec3::Zero())
      : model(link), pressure_mpa(pressure_kpa * 1e-3) {
    PressedSkin skin(model, {.refinement = 3, .step_mm = 2});
    EXPECT_TRUE(skin.Inflate(pressure_mpa).ok());
    const auto node = static_cast<size_t>(skin.mesh().NodeOfMarker(model, model.MarkerIndex(6, 4)));
    const Vec3 axis = skin.mesh().normals[node];
    const Vec3 outside = skin.state().mids_mm[node] + (model.thickness_mm / 2 + 0.1) * axis;
    const double out = (outside - skin.mesh().mid_mm[node]).dot(axis) - model.thickness_mm / 2;
    skin.AddBody(RigidStamp{outside, -axis, 2.75}, true);
    const Vec3 by = -(out + depth_mm) * axis;
    EXPECT_TRUE(depth_mm == 0 || skin.Move({&by, 1}).ok());
    EXPECT_TRUE(drag_mm.isZero() || skin.Move({&drag_mm, 1}).ok());
    contact = skin.ContactOf(0);
    for (int m = 0; m < model.markers.count(); ++m)
      displacements.push_back(skin.Marker(m) - model.RestMarker(m));
  }

  SkinShape Measured(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    SkinShape shape;
    const Mat3 covariance = Vec3(1, 1, 9).asDiagonal() * (kNoiseMm * kNoiseMm);
    for (int m = 0; m < model.markers.count(); ++m) {
      const Vec3 error = kNoiseMm * DrawnVec3([&] { return normal(random); }).cwiseProduct(Vec3(1, 1, 3));
      const Vec3 u = displacements[static_cast<size_t>(m)] + error;
      shape.displacements_mm.push_back(u);
      shape.positions_mm.push_back(model.RestMarker(m) + u);
      shape.covariances_mm2.push_back(covariance);
      shape.measured.push_back({u, covariance.inverse()});
      shape.sources.push_back(MarkerSource::kBoth);
    }
    return shape;
  }

  LinkModel model;
  double pressure_mpa;
  RigidContact::Summary contact;
  std::vector<Vec3> displacements;
};

struct Estimate {
  NodalForces forces;
  std::vector<Contact> contacts;
};

Estimate EstimateOf(ForceEstimator& estimator, const Push& push, int frames = 3) {
  Estimate result;
  ContactFinder finder(push.model);
  for (int i = 0; i < frames; ++i) {
    const SkinShape shape = push.Measured(static_cast<unsigned>(i + 1));
    estimator.Estimate(shape, push.pressure_mpa, result.forces);
    finder.Find(shape, result.forces, result.contacts);
  }
  return result;
}

class ForceModelsTest : public testing::Test {
 protected:
  static const LinkModel& Cylinder() {
    static const LinkModel model = LoadLinkModel("cylinder").value();
    return model;
  }
  static const Push& Pressed() {
    static const Push push(Cylinder(), 1, 5);
    return push;
  }
};

TEST_F(ForceModelsTest, NonlinearAgreesWithTheForwardSolver) {
  for (const int refinement : {1, 2}) {
    const auto estimator =
        MakeForceEstimator(Cylinder(), {.model = ForceModel::kNonlinear, .refinement = refinement});
    const Estimate found = EstimateOf(*estimator, Pressed());
    ASSERT_EQ(found.contacts.size(), 1u);
    EXPECT_TRUE(found.forces.converged);
    EXPECT_EQ(found.forces.model, ForceModel::kNonlinear);
    const double truth = Pressed().contact.force_n.norm();
    EXPECT_NEAR(found.contacts[0].force_n.norm() / truth, 1, 0.05);
    const double off = (found.contacts[0].center_mm - Pressed().contact.center_mm).norm();
    EXPECT_LT(off, 3);
    ASSERT_TRUE(found.contacts[0].center_covariance_mm2.has_value());
    const double told = std::sqrt(found.contacts[0].center_covariance_mm2->trace());
    EXPECT_GT(told, off / 3);
    EXPECT_LT(told, 5);
  }
}

// 18 mm from one frame to the next, which is more than a frame's iterations reach.
TEST_F(ForceModelsTest, AHitTooDeepForOneFrameIsFoundInTheNext) {
  const Push push(Cylinder(), 0, 18);
  const auto estimator = MakeForceEstimator(Cylinder(), {.model = ForceModel::kNonlinear});
  const NodalForces first = EstimateOf(*estimator, push, 1).forces;
  EXPECT_FALSE(first.converged);
  EXPECT_EQ(first.model, ForceModel::kPressurised);
  const Estimate next = EstimateOf(*estimator, push, 2);
  EXPECT_TRUE(next.forces.converged);
  EXPECT_EQ(next.forces.model, ForceModel::kNonlinear);
  ASSERT_EQ(next.contacts.size(), 1u);
  EXPECT_NEAR(next.contacts[0].force_n.norm() / push.contact.force_n.norm(), 1, 0.05);
}

TEST_F(ForceModelsTest, PressurisedIsNear) {
  const auto estimator = MakeForceEstimator(Cylinder(), {.model = ForceModel::kPressurised});
  const Estimate found = EstimateOf(*estimator, Pressed());
  ASSERT_EQ(found.contacts.size(), 1u);
  EXPECT_NEAR(found.contacts[0].force_n.norm() / Pressed().contact.force_n.norm(), 1, 0.1);
}

TEST_F(ForceModelsTest, ADragIsATangentialForceWithItsUncertainty) {
  const Push drag(Cylinder(), 1, 5, Vec3(0, 0, 4));
  ASSERT_GT(drag.contact.force_n.z(), 0.1);
  const auto estimator = MakeForceEstimator(Cylinder(), {.model = ForceModel::kNonlinear});
  const Estimate found = EstimateOf(*estimator, drag);
  ASSERT_EQ(found.contacts.size(), 1u);
  EXPECT_NEAR(found.contacts[0].force_n.z(), drag.contact.force_n.z(), 0.1 * drag.contact.force_n.norm());
  ASSERT_TRUE(found.contacts[0].force_covariance_n2.has_value());
  EXPECT_GT(Sigmas(*found.contacts[0].force_covariance_n2).z(), 0);
  EXPECT_LT(Sigmas(*found.contacts[0].force_covariance_n2).z(), 0.1);
}

TEST_F(ForceModelsTest, AutomaticTakesTheCheapestThatIsGoodEnough) {
  AutoEstimator estimator(Cylinder(), {.model = {}, .tolerance = 0.05});
  EXPECT_LE(estimator.ErrorOf(ForceModel::kLinear, 0, 0.1), estimator.ErrorOf(ForceModel::kLinear, 1e-3, 5));
  const Push rest(Cylinder(), 0, 0);
  EXPECT_EQ(EstimateOf(estimator, rest).forces.model, ForceModel::kLinear);
  const Estimate pressed = EstimateOf(estimator, Pressed());
  EXPECT_EQ(pressed.forces.model, ForceModel::kNonlinear);
  ASSERT_EQ(pressed.contacts.size(), 1u);
  EXPECT_NEAR(pressed.contacts[0].force_n.norm() / Pressed().contact.force_n.norm(), 1, 0.05);
}

// What is remembered from a frame must not mislead the next one: other covariances, other contacts, other
// pressures.
TEST_F(ForceModelsTest, UnlikeFramesAnswerAsIfTheyWereTheFirst) {
  const Push elsewhere(Cylinder(), 0, 3, Vec3(0, 0, -8));
  SkinShape one_camera = elsewhere.Measured(1);
  for (size_t m = 0; m < one_camera.measured.size(); m += 2) {
    one_camera.measured[m].information_per_mm2 *= 0.05;
    one_camera.sources[m] = MarkerSource::kTop;
  }
  const Push rest(Cylinder(), 1, 0);
  const std::pair<SkinShape, double> frames[] = {{Pressed().Measured(1), 1e-3},
                                                 {one_camera, 0},
                                                 {rest.Measured(3), 1e-3},
                                                 {Pressed().Measured(4), 1e-3}};
  const auto total = [](const NodalForces& forces) {
    Vec3 sum = Vec3::Zero();
    for (const Vec3& f : forces.forces_n) sum += f;
    return sum;
  };
  for (const ForceModel model : {ForceModel::kLinear, ForceModel::kPressurised, ForceModel::kNonlinear}) {
    const auto played = MakeForceEstimator(Cylinder(), {.model = model, .refinement = 1});
    for (size_t i = 0; i < std::size(frames); ++i) {
      NodalForces again, first;
      played->Estimate(frames[i].first, frames[i].second, again);
      MakeForceEstimator(Cylinder(), {.model = model, .refinement = 1})
          ->Estimate(frames[i].first, frames[i].second, first);
      EXPECT_EQ(again.converged, first.converged) << Name(model) << ", frame " << i;
      EXPECT_LT((total(again) - total(first)).norm(), 0.02 + 0.05 * total(first).norm())
          << Name(model) << ", frame " << i << ": " << total(again).transpose() << " instead of "
          << total(first).transpose();
    }
  }
}

TEST_F(ForceModelsTest, LiteralAmplifiesNoise) {
  const auto estimator = MakeForceEstimator(Cylinder(), {.model = ForceModel::kLiteral});
  const Push rest(Cylinder(), 0, 0);
  const Estimate found = EstimateOf(*estimator, rest, 1);
  double total = 0;
  for (const Vec3& f : found.forces.forces_n) total += f.norm();
  EXPECT_GT(total, 1) << "N of force that is not there";
}

// The bound on phantoms is Bonferroni's: the true rate is lower.
TEST_F(ForceModelsTest, NoiseMakesPhantomsNoMoreOftenThanStated) {
  constexpr double kPerFrame = 0.02;
  constexpr int kFrames = 1000;
  ComplianceEstimator estimator(
      Cylinder(), ForceModel::kLinear,
      {.refinement = 1, .phantoms_per_hour = kPerFrame * 3600 * 30, .noise_floor_mm = 0});
  const Push rest(Cylinder(), 0, 0);
  int phantoms = 0;
  NodalForces forces;
  for (unsigned seed = 0; seed < kFrames; ++seed) {
    estimator.Restart();
    estimator.Estimate(rest.Measured(seed), 0, forces);
    phantoms += forces.loaded.empty() ? 0 : 1;
  }
  EXPECT_LE(phantoms, kPerFrame * kFrames + 3 * std::sqrt(kPerFrame * kFrames));
  EXPECT_GT(phantoms, 0) << "so that the bound means something";
}

TEST_F(ForceModelsTest, WhatIsNoNumberIsLeftOut) {
  const auto estimator = MakeForceEstimator(Cylinder(), {.model = ForceModel::kNonlinear});
  SkinShape shape = Pressed().Measured(1);
  shape.measured[10].displacement_mm.setConstant(std::numeric_limits<double>::quiet_NaN());
  shape.measured[30].information_per_mm2(0, 0) = std::numeric_limits<double>::infinity();
  NodalForces forces;
  estimator->Estimate(shape, Pressed().pressure_mpa, forces);
  Vec3 total = Vec3::Zero();
  for (const Vec3& f : forces.forces_n) total += f;
  EXPECT_NEAR(total.norm() / Pressed().contact.force_n.norm(), 1, 0.1);
  estimator->Estimate(shape, std::numeric_limits<double>::quiet_NaN(), forces);
  EXPECT_FALSE(forces.converged);
  EXPECT_TRUE(forces.loaded.empty());
}

}  // namespace
}  // namespace taclink

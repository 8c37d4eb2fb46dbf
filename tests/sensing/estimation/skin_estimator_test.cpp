#include "sensing/estimation/skin_estimator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "sensing/contact/contact_finder.h"
#include "sensing/model/model_file.h"
#include "tests/sensing/estimation/pushed_skin.h"
#include "tests/support/moved_cameras.h"

namespace taclink {
namespace {

TEST_F(SkinEstimatorTest, FindsAForceItsPlaceAndTheShape) {
  for (const double kpa : {0.0, 1.0}) {
    const double force_n = kpa > 0 ? 0.6 : 0.1;
    const Pushed pushed = Push(model_, kpa, 1.3, 95, force_n, 4);
    ASSERT_TRUE(pushed.ok);
    estimator_.Estimate(Observe(pushed.markers_mm, kpa, 0.02), estimate_);
    ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
    ASSERT_EQ(estimate_.loads.loads.size(), 1u);
    const Vec3 truth = -force_n * model_.OutwardNormal(1.3, 95);
    EXPECT_LT((estimate_.loads.loads[0].force_n - truth).norm(), 0.05 * force_n) << kpa;
    EXPECT_LT((estimate_.displacements_mm - pushed.markers_mm).norm() / std::sqrt(240), 0.05) << kpa;
    ContactFinder finder(model_);
    std::vector<Contact> contacts;
    finder.Find(estimator_, estimate_, contacts);
    ASSERT_EQ(contacts.size(), 1u);
    const Vec3 at = model_.PointAtDepth(1.3, 95, 0);
    EXPECT_NEAR(std::atan2(contacts[0].center_mm.y(), contacts[0].center_mm.x()), 1.3, 0.03);
    EXPECT_NEAR(contacts[0].center_mm.z(), at.z(), 1);
    // Of a load on a small patch the moment is the center's arm times the force.
    const Vec3 moment = contacts[0].center_mm.cross(contacts[0].force_n);
    EXPECT_LT((contacts[0].moment_nmm - moment).norm(), 0.05 * moment.norm());
    EXPECT_GT(contacts[0].peak_pressure_mpa * contacts[0].area_mm2, 0.8 * force_n);
    ASSERT_GE(contacts[0].outline_mm.size(), 4u);
    for (const Vec3& corner : contacts[0].outline_mm) EXPECT_LT((corner - contacts[0].center_mm).norm(), 25);
  }
}

// Cameras that have moved or turned shift all markers alike, or along z by where they are, or are rolled
// against each other: no load, and none of a load's force along the wall.
TEST_F(SkinEstimatorTest, CamerasThatMovedAreNoForce) {
  const Vec3 middle(0, 0, model_.length_mm / 2);
  const Vec3 turn(0, 0.006, 0), shift(0.2, 0, 0.3), roll(0, 0, 0.007);
  for (const double force_n : {0.0, 0.4}) {
    const Pushed pushed = Push(model_, 1.0, 1.3, 95, force_n, 4);
    ASSERT_TRUE(pushed.ok);
    Eigen::VectorXd moved_mm = pushed.markers_mm, rolled_mm = pushed.markers_mm;
    for (int m = 0; m < model_.markers.count(); ++m) {
      const Vec3 at = model_.RestMarker(m), from_middle = at - middle;
      const Vec3 bow(0, 0, 0.2 * std::sin(kPi * at.z() / model_.length_mm));
      moved_mm.segment<3>(3 * m) += turn.cross(from_middle) + shift + bow;
      rolled_mm.segment<3>(3 * m) += from_middle.z() / middle.z() * roll.cross(from_middle);
    }
    for (const Eigen::VectorXd* seen_mm : {&moved_mm, &rolled_mm}) {
      estimator_.Estimate(Observe(*seen_mm, 1.0, 0.05), estimate_);
      ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
      EXPECT_GT(estimate_.loads.camera_shift_mm, seen_mm == &moved_mm ? 0.5 : 0.15);
      EXPECT_LT(estimate_.loads.camera_shift_mm, 1.5);
      ASSERT_EQ(estimate_.loads.loads.size(), force_n > 0 ? 1u : 0u);
      if (force_n == 0) continue;
      const Vec3 truth = -force_n * model_.OutwardNormal(1.3, 95);
      EXPECT_LT((estimate_.loads.loads[0].force_n - truth).norm(), 0.1 * force_n);
    }
    estimator_.Estimate(Observe(pushed.markers_mm, 1.0, 0.05), estimate_);
    EXPECT_LT(estimate_.loads.camera_shift_mm, 0.1);
  }
}

// One of the two, sideways, along or turned: what lines of sight that are taken for the old camera's make of
// it.
TEST_F(SkinEstimatorTest, OneCameraThatMovedIsNoForce) {
  for (const double force_n : {0.0, 0.4}) {
    const Pushed pushed = Push(model_, 1.0, 1.3, 95, force_n, 4);
    ASSERT_TRUE(pushed.ok);
    for (const CameraId id : kBothCameras) {
      for (const int parameter : {0, 3, 5}) {
        CameraStep step = CameraStep::Zero();
        step[parameter] = parameter < 3 ? RadFromDeg(0.15) : 0.3;
        StereoRig moved = model_.nominal_rig;
        moved[id] = Moved(moved[id], step);
        estimator_.Estimate(Observe(SeenByMoved(model_, moved, pushed.markers_mm), 1.0, 0.05), estimate_);
        ASSERT_EQ(estimate_.failure, EstimateFailure::kNone) << Name(id) << " " << parameter;
        EXPECT_GT(estimate_.loads.camera_shift_mm, 0.2) << Name(id) << " " << parameter;
        EXPECT_LT((estimate_.displacements_mm - pushed.markers_mm).norm() / std::sqrt(240), 0.08)
            << Name(id) << " " << parameter;
        ASSERT_EQ(estimate_.loads.loads.size(), force_n > 0 ? 1u : 0u) << Name(id) << " " << parameter;
        if (force_n == 0) continue;
        const Vec3 truth = -force_n * model_.OutwardNormal(1.3, 95);
        EXPECT_LT((estimate_.loads.loads[0].force_n - truth).norm(), 0.1 * force_n)
            << Name(id) << " " << parameter;
      }
    }
  }
}

// An untouched skin is told in short; what is told of it does not depend on the frames before either.
TEST_F(SkinEstimatorTest, ARestingSkinIsColdAndWarmAlike) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.05);
  for (int frame = 0; frame < 4; ++frame) {
    Eigen::VectorXd markers_mm(3 * model_.markers.count());
    for (double& u : markers_mm) u = noise(random);
    const SkinObservation observation = Observe(markers_mm, 0, 0.05);
    SkinEstimator fresh(model_);
    SkinEstimate cold;
    fresh.Estimate(observation, cold);
    estimator_.Estimate(observation, estimate_);
    ASSERT_EQ(cold.failure, EstimateFailure::kNone);
    ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
    EXPECT_TRUE(estimate_.loads.loads.empty());
    EXPECT_NEAR(estimate_.loads.chi2_per_dof, cold.loads.chi2_per_dof, 1e-6);
    EXPECT_NEAR(estimate_.known_loads.pressure_mpa, cold.known_loads.pressure_mpa, 1e-9);
    EXPECT_NEAR(estimate_.loads.known_covariance(0, 0), cold.loads.known_covariance(0, 0), 1e-9);
    EXPECT_LT((estimate_.displacements_mm - cold.displacements_mm).cwiseAbs().maxCoeff(), 1e-6);
  }
}

// Also where no marker by itself is off by more than noise may be.
TEST_F(SkinEstimatorTest, CamerasThatMovedALittleAreNotAtRest) {
  Eigen::VectorXd markers_mm = Eigen::VectorXd::Zero(3 * model_.markers.count());
  for (Eigen::Index m = 0; m < markers_mm.size() / 3; ++m) markers_mm[3 * m + 2] = 0.3;
  const SkinObservation observation = Observe(markers_mm, 0, 0.1);
  for (int frame = 0; frame < 2; ++frame) {
    estimator_.Estimate(observation, estimate_);
    ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
    EXPECT_TRUE(estimate_.loads.loads.empty());
    EXPECT_NEAR(estimate_.loads.camera_shift_mm, 0.3, 0.05) << "frame " << frame;
  }
}

TEST_F(SkinEstimatorTest, ABandAllAroundIsOneContact) {
  const Pushed pushed = Push(model_, 1, {}, 95, 3, 6);
  ASSERT_TRUE(pushed.ok);
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.05);
  Eigen::VectorXd markers_mm = pushed.markers_mm;
  for (double& u : markers_mm) u += noise(random);
  estimator_.Estimate(Observe(markers_mm, 1, 0.05), estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  ContactFinder finder(model_);
  std::vector<Contact> contacts;
  finder.Find(estimator_, estimate_, contacts);
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_TRUE(contacts[0].is_ring_contact);
  EXPECT_NEAR(contacts[0].normal_force_n, 3, 0.3);
  EXPECT_LT(contacts[0].force_n.norm(), 0.1);
  EXPECT_LT((contacts[0].center_mm - Vec3(0, 0, 95)).norm(), 3);
  for (const Vec3& point : contacts[0].outline_mm) EXPECT_GT(point.head<2>().norm(), 30) << "on the skin";
}

TEST_F(SkinEstimatorTest, PressureThatIsToldWrongIsNoForce) {
  const Pushed inflated = Push(model_, 1.0, 1.3, 95, 0, 4);
  ASSERT_TRUE(inflated.ok);
  SkinObservation observation = Observe(inflated.markers_mm, 1.1, 0.02);
  observation.loads.pressure_sigma_mpa = 5e-5;
  estimator_.Estimate(observation, estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  EXPECT_TRUE(estimate_.loads.loads.empty());
  EXPECT_NEAR(estimate_.known_loads.pressure_mpa, 1e-3, 2e-5);
}

// Displacements of a slack skin that is pressed, from a baseline that is said to have been inflated.
TEST_F(SkinEstimatorTest, ABaselinesPressureThatIsToldWrongShows) {
  const Pushed pushed = Push(model_, 0, 1.3, 95, 0.1, 4);
  ASSERT_TRUE(pushed.ok);
  SkinObservation observation = Observe(pushed.markers_mm, 0, 0.05);
  observation.loads.pressure_sigma_mpa = observation.baseline_loads.pressure_sigma_mpa = 5e-5;
  observation.baseline_loads.pressure_mpa = 5e-4;
  estimator_.Estimate(observation, estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  EXPECT_LT(estimate_.loads.baseline_error[0], -3e-4);
  observation.baseline_loads.pressure_mpa = 0;
  estimator_.Estimate(observation, estimate_);
  EXPECT_EQ(estimate_.loads.baseline_error[0], 0);
}

TEST_F(SkinEstimatorTest, TheShapeFollowsMarkersThatTheModelIsWrongAbout) {
  const Pushed inflated = Push(model_, 1.0, 1.3, 95, 0, 4);
  ASSERT_TRUE(inflated.ok);
  // No pressure does this.
  Eigen::VectorXd truth = inflated.markers_mm;
  for (int m = 0; m < 240; ++m)
    truth.segment<3>(3 * m) *= 1 + 0.03 * std::sin(2 * kPi * model_.RestMarker(m).z() / model_.length_mm);
  SkinObservation observation = Observe(truth, 1.0, 0.02);
  observation.loads.pressure_sigma_mpa = 1e-6;
  // Every fifth is not seen, and follows its neighbors.
  for (size_t m = 0; m < 240; m += 5) observation.markers.information[m].setZero();
  estimator_.Estimate(observation, estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  EXPECT_TRUE(estimate_.loads.loads.empty());
  Eigen::VectorXd equilibrium;
  estimator_.mechanics().markers().Displacements(estimate_.state, equilibrium);
  const double equilibrium_off_mm = (equilibrium - truth).cwiseAbs().maxCoeff();
  EXPECT_GT(equilibrium_off_mm, 0.05);
  EXPECT_LT((estimate_.displacements_mm - truth).cwiseAbs().maxCoeff(), 0.5 * equilibrium_off_mm);
}

TEST_F(SkinEstimatorTest, ABaselineUnderPressureIsNoForce) {
  const Pushed before = Push(model_, 1.0, 1.3, 95, 0, 4), now = Push(model_, 0.8, 1.3, 95, 0.4, 4);
  ASSERT_TRUE(before.ok && now.ok);
  SkinObservation observation = Observe(now.markers_mm - before.markers_mm, 0.8, 0.02);
  observation.baseline_loads = {1e-3, 3e-5};
  estimator_.Estimate(observation, estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  ASSERT_EQ(estimate_.loads.loads.size(), 1u);
  EXPECT_NEAR(estimate_.loads.loads[0].force_n.norm(), 0.4, 0.03);
}

TEST_F(SkinEstimatorTest, WhatIsNotSeenFollowsFromTheLoads) {
  const Pushed pushed = Push(model_, 0.5, 1.3, 95, 0.3, 4);
  ASSERT_TRUE(pushed.ok);
  SkinObservation observation = Observe(pushed.markers_mm, 0.5, 0.02);
  for (size_t m = 0; m < 240; m += 3) observation.markers.information[m].setZero();
  for (size_t m = 0; m < 240; m += 3) observation.markers.displacement_mm[m].setConstant(1e6);
  estimator_.Estimate(observation, estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  EXPECT_LT((estimate_.displacements_mm - pushed.markers_mm).cwiseAbs().maxCoeff(), 0.3);
  ASSERT_EQ(estimate_.loads.loads.size(), 1u);
  EXPECT_NEAR(estimate_.loads.loads[0].force_n.norm(), 0.3, 0.03);
}

TEST_F(SkinEstimatorTest, NonsenseIsRefusedAndForgotten) {
  const Pushed pushed = Push(model_, 0.5, 1.3, 95, 0.3, 4);
  ASSERT_TRUE(pushed.ok);
  const SkinObservation good = Observe(pushed.markers_mm, 0.5, 0.02);
  SkinObservation nonsense = good;
  for (Vec3& u : nonsense.markers.displacement_mm) u = -3 * u + Vec3(30, 0, 0);
  SkinObservation unstable = good;
  unstable.loads.pressure_mpa = 1;
  estimator_.Estimate(unstable, estimate_);
  EXPECT_EQ(estimate_.failure, EstimateFailure::kNoEquilibrium);
  estimator_.Estimate(nonsense, estimate_);
  EXPECT_NE(estimate_.failure, EstimateFailure::kNone);
  estimator_.Estimate(good, estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  ASSERT_EQ(estimate_.loads.loads.size(), 1u);
  const Vec3 warm = estimate_.loads.loads[0].force_n;
  const double sigma = std::sqrt(estimate_.loads.loads[0].force_covariance_n2.trace());
  SkinEstimator fresh(model_);
  fresh.Estimate(good, estimate_);
  ASSERT_EQ(estimate_.loads.loads.size(), 1u);
  EXPECT_LT((estimate_.loads.loads[0].force_n - warm).norm(), 0.2 * sigma);
}

// What is torn, shifted or seen in a mirror ends soon, and the next frame is answered as if there had been
// none of it.
TEST_F(SkinEstimatorTest, ABadFrameCostsLittleAndOnlyItself) {
  const Pushed first = Push(model_, 1, 1.3, 95, 0.8, 4), second = Push(model_, 1, -0.5, 60, 0.8, 4);
  ASSERT_TRUE(first.ok && second.ok);
  const SkinObservation good = Observe(first.markers_mm, 1, 0.05);
  std::vector<Eigen::VectorXd> bad(4, first.markers_mm);
  for (int m = 0; m < model_.markers.count(); ++m) {
    const auto part = Eigen::seqN(3 * m, 3);
    if (m % 2 == 0) bad[0](part) = second.markers_mm(part) + Vec3(0, 6, 0);
    if (model_.RestMarker(m).x() > 0) bad[1](part) += Vec3(9, -9, 4);
    bad[2](part) = -2 * first.markers_mm(part);
    bad[3](part) = Vec3(8, 5, -7) * std::sin(0.37 * m);
  }
  constexpr int kLastStepUnits = 24 / 2 + 2 * 20 + 5 + 750;  // assimilation, tangents and a fit
  SkinEstimator estimator(model_, {.most_work = FrameWork::kLiveUnits});
  for (const Eigen::VectorXd& markers_mm : bad) {
    for (int frame = 0; frame < 3; ++frame) estimator.Estimate(good, estimate_);
    ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
    estimator.Estimate(Observe(markers_mm, 1, 0.05), estimate_);
    EXPECT_NE(estimate_.failure, EstimateFailure::kNone);
    EXPECT_LE(estimate_.work.Units(), FrameWork::kLiveUnits + kLastStepUnits);
    estimator.Estimate(good, estimate_);
    ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
    EXPECT_EQ(estimate_.work.evaluations, 0);
    SkinEstimator fresh(model_);
    SkinEstimate cold;
    fresh.Estimate(good, cold);
    ASSERT_EQ(estimate_.loads.loads.size(), cold.loads.loads.size());
    const double sigma_n = std::sqrt(cold.loads.loads[0].force_covariance_n2.trace());
    EXPECT_LT((estimate_.loads.loads[0].force_n - cold.loads.loads[0].force_n).norm(), 0.2 * sigma_n);
  }
}

// What a frame's work does not suffice for comes to its answer in the next ones.
TEST_F(SkinEstimatorTest, ADearFrameIsAnsweredByTheNextOnes) {
  const Pushed pushed = Push(model_, 1, 1.3, 95, 0.8, 4);
  ASSERT_TRUE(pushed.ok);
  const SkinObservation seen = Observe(pushed.markers_mm, 1, 0.05);
  SkinEstimator thrifty(model_, {.most_work = 25});
  int frames = 0;
  do {
    thrifty.Estimate(seen, estimate_);
    ASSERT_LT(++frames, 6);
  } while (estimate_.failure != EstimateFailure::kNone);
  EXPECT_GT(frames, 1);
  SkinEstimate cold;
  estimator_.Estimate(seen, cold);
  ASSERT_EQ(estimate_.loads.loads.size(), cold.loads.loads.size());
  const double sigma_n = std::sqrt(cold.loads.loads[0].force_covariance_n2.trace());
  EXPECT_LT((estimate_.loads.loads[0].force_n - cold.loads.loads[0].force_n).norm(), 0.2 * sigma_n);
}

// A sensor scatters about zero, and a little suction buckles this skin: no reading that is true within its
// deviation costs the frame, and what is told beyond what the skin stands does not change the force.
TEST_F(SkinEstimatorTest, ReadingsBelowZeroAreNoSuction) {
  const Pushed pushed = Push(model_, 0, 1.3, 95, 0.2, 4);
  ASSERT_TRUE(pushed.ok);
  for (const double kpa : {0.0, -0.002, -0.02, -0.05, -0.08, -0.12}) {
    SkinObservation observation = Observe(pushed.markers_mm, kpa, 0.05);
    observation.loads.pressure_sigma_mpa = 5e-5;
    estimator_.Estimate(observation, estimate_);
    ASSERT_EQ(estimate_.failure, EstimateFailure::kNone) << kpa;
    ASSERT_EQ(estimate_.loads.loads.size(), 1u) << kpa;
    EXPECT_NEAR(estimate_.loads.loads[0].force_n.norm(), 0.2, 0.01) << kpa;
    EXPECT_NEAR(estimate_.known_loads.pressure_mpa, 0, 1e-5) << kpa;
    // Untouched, with a baseline whose reading was off likewise.
    observation = Observe(Eigen::VectorXd::Zero(pushed.markers_mm.size()), -kpa, 0.05);
    observation.baseline_loads = {1e-3 * kpa, 5e-5};
    observation.loads.pressure_sigma_mpa = 5e-5;
    estimator_.Estimate(observation, estimate_);
    ASSERT_EQ(estimate_.failure, EstimateFailure::kNone) << kpa;
    EXPECT_TRUE(estimate_.loads.loads.empty()) << kpa;
  }
}

// A second body, while the first stands and its tangent, which has columns about it alone, is kept.
TEST_F(SkinEstimatorTest, ASecondContactFarFromTheFirstIsFound) {
  const Pushed none = Push(model_, 1.0, 1.3, 95, 0, 4), first = Push(model_, 1.0, 1.3, 95, 0.4, 4),
               second = Push(model_, 1.0, -1.8, 150, 0.3, 4);
  ASSERT_TRUE(none.ok && first.ok && second.ok);
  const Eigen::VectorXd both_mm = first.markers_mm + second.markers_mm - none.markers_mm;
  for (int frame = 0; frame < 3; ++frame)
    estimator_.Estimate(Observe(first.markers_mm, 1.0, 0.05), estimate_);
  ASSERT_EQ(estimate_.loads.loads.size(), 1u);
  estimator_.Estimate(Observe(both_mm, 1.0, 0.05), estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  ASSERT_EQ(estimate_.loads.loads.size(), 2u);
  SkinEstimator fresh(model_);
  SkinEstimate cold;
  fresh.Estimate(Observe(both_mm, 1.0, 0.05), cold);
  ASSERT_EQ(cold.loads.loads.size(), 2u);
  for (const EstimatedLoad& load : estimate_.loads.loads) {
    const bool is_first = load.force_n.dot(model_.OutwardNormal(1.3, 95)) < 0;
    const Vec3 truth =
        is_first ? -0.4 * model_.OutwardNormal(1.3, 95) : -0.3 * model_.OutwardNormal(-1.8, 150);
    EXPECT_LT((load.force_n - truth).norm(), 0.1 * truth.norm());
    const auto same =
        std::min_element(cold.loads.loads.begin(), cold.loads.loads.end(), [&](const auto& a, const auto& b) {
          return (a.force_n - load.force_n).norm() < (b.force_n - load.force_n).norm();
        });
    EXPECT_LT((load.force_n - same->force_n).norm(), 0.2 * std::sqrt(same->force_covariance_n2.trace()));
  }
}

// In and out, while tangents are made ahead: each frame's answer is that of an estimator that saw only it,
// and to the last bit that of one that has no second thread.
// Between them a force along the wall would explain much of what both do.
TEST_F(SkinEstimatorTest, AWeakContactBesideAStrongOneIsFound) {
  const double strong_n = 0.8, weak_n = 0.12;
  const Pushed none = Push(model_, 1, 1.3, 95, 0, 4), strong = Push(model_, 1, 1.3, 95, strong_n, 4);
  ASSERT_TRUE(none.ok && strong.ok);
  for (const double off_mm : {42.0, 50.0}) {
    for (const bool is_along : {false, true}) {
      const double angle = is_along ? 1.3 : 1.3 + off_mm / model_.PointAtDepth(1.3, 95, 0).head<2>().norm();
      const double z = is_along ? 95 + off_mm : 95;
      const Pushed weak = Push(model_, 1, angle, z, weak_n, 4);
      ASSERT_TRUE(weak.ok);
      SkinEstimator estimator(model_);
      estimator.Estimate(Observe(none.markers_mm, 1, 0.05), estimate_);
      estimator.Estimate(Observe(strong.markers_mm + weak.markers_mm - none.markers_mm, 1, 0.05), estimate_);
      ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
      ASSERT_EQ(estimate_.loads.loads.size(), 2u) << off_mm << is_along;
      for (const EstimatedLoad& load : estimate_.loads.loads) {
        const bool is_strong = load.normal_force_n > 0.4;
        const Vec3 truth =
            is_strong ? -strong_n * model_.OutwardNormal(1.3, 95) : -weak_n * model_.OutwardNormal(angle, z);
        EXPECT_LT((load.force_n - truth).norm(), 0.1 * strong_n) << off_mm << is_along << load.force_n;
      }
    }
  }
}

// A body hides markers from one camera and the other sees them badly, of which the skin without loads knew
// nothing.
TEST_F(SkinEstimatorTest, MarkersThatOneCameraSeesWorseSayLess) {
  const double far_mm = 0.3;
  const Pushed none = Push(model_, 1, 1.3, 95, 0, 4), pushed = Push(model_, 1, 1.3, 95, 0.4, 4);
  ASSERT_TRUE(none.ok && pushed.ok);
  SkinObservation seen = Observe(pushed.markers_mm, 1, 0.05);
  const Vec3 hidden = model_.PointAtDepth(1.3, 95, 0);
  for (int m = 0; m < model_.markers.count(); ++m) {
    const Vec3 at = model_.RestMarker(m), sight = (at - Vec3(0, 0, -10)).normalized();
    if ((at - hidden).norm() < 25)
      seen.markers.information[static_cast<size_t>(m)] =
          (Mat3::Identity() - sight * sight.transpose()) / (far_mm * far_mm);
  }
  estimator_.Estimate(Observe(none.markers_mm, 1, 0.05), estimate_);
  estimator_.Estimate(seen, estimate_);
  ASSERT_EQ(estimate_.loads.loads.size(), 1u);
  const double sigma_n = std::sqrt(estimate_.loads.loads[0].force_covariance_n2.trace());
  SkinEstimator fresh(model_);
  SkinEstimate cold;
  fresh.Estimate(seen, cold);
  ASSERT_EQ(cold.loads.loads.size(), 1u);
  const double cold_n = std::sqrt(cold.loads.loads[0].force_covariance_n2.trace());
  EXPECT_NEAR(sigma_n / cold_n, 1, 0.1) << sigma_n << " " << cold_n;
  EXPECT_NEAR(estimate_.loads.region_chi2_per_dof, cold.loads.region_chi2_per_dof, 0.1);
}

// Half of the markers change the camera that sees them: what the skin without loads was weighed with does not
// show what is seen now.
TEST_F(SkinEstimatorTest, AnotherCameraIsAsGoodAsTheFirst) {
  const Pushed none = Push(model_, 1, 1.3, 95, 0, 4), pushed = Push(model_, 1, 1.3, 95, 0.4, 4);
  ASSERT_TRUE(none.ok && pushed.ok);
  const auto by_one_camera = [&](const Eigen::VectorXd& markers_mm, double camera_z) {
    SkinObservation seen = Observe(markers_mm, 1, 0.05);
    for (int m = 0; m < model_.markers.count(); ++m) {
      const Vec3 at = model_.RestMarker(m), sight = (at - Vec3(0, 0, camera_z)).normalized();
      if (at.y() > 0)
        seen.markers.information[static_cast<size_t>(m)] =
            (Mat3::Identity() - sight * sight.transpose()) / (0.05 * 0.05);
    }
    return seen;
  };
  estimator_.Estimate(by_one_camera(none.markers_mm, -10), estimate_);
  ASSERT_TRUE(estimate_.loads.loads.empty());
  const SkinObservation now = by_one_camera(pushed.markers_mm, model_.length_mm + 10);
  estimator_.Estimate(now, estimate_);
  SkinEstimator fresh(model_);
  SkinEstimate cold;
  fresh.Estimate(now, cold);
  ASSERT_EQ(estimate_.loads.loads.size(), cold.loads.loads.size());
  ASSERT_EQ(cold.loads.loads.size(), 1u);
  const double sigma_n = std::sqrt(cold.loads.loads[0].force_covariance_n2.trace());
  EXPECT_LT((estimate_.loads.loads[0].force_n - cold.loads.loads[0].force_n).norm(), 0.2 * sigma_n);
  EXPECT_NEAR(std::sqrt(estimate_.loads.loads[0].force_covariance_n2.trace()) / sigma_n, 1, 0.1);
}

// A contact that moves by a few millimeters a frame: cold and warm.
TEST_F(SkinEstimatorTest, FramesBeforeChangeNoAnswer) {
  std::vector<SkinObservation> stages;
  for (const double force_n : {0.1, 0.25, 0.4, 0.5, 0.6}) {
    const Pushed pushed = Push(model_, 1.0, 1.3, 95, force_n, 4);
    ASSERT_TRUE(pushed.ok);
    stages.push_back(Observe(pushed.markers_mm, 1.0, 0.02));
  }
  SkinEstimator live(model_);
  for (int frame = 0; frame < 24; ++frame) {
    const int back = frame % 8;
    const SkinObservation& seen = stages[static_cast<size_t>(back < 5 ? back : 8 - back)];
    SkinEstimate with;
    live.Estimate(seen, with);
    estimator_.Restart();
    estimator_.Estimate(seen, estimate_);
    ASSERT_EQ(with.failure, EstimateFailure::kNone);
    ASSERT_EQ(with.loads.loads.size(), 1u);
    ASSERT_EQ(estimate_.loads.loads.size(), 1u);
    const EstimatedLoad& cold = estimate_.loads.loads[0];
    EXPECT_LT((with.loads.loads[0].force_n - cold.force_n).norm(),
              0.2 * std::sqrt(cold.force_covariance_n2.trace()));
    EXPECT_LT((with.displacements_mm - estimate_.displacements_mm).cwiseAbs().maxCoeff(), 0.05);
  }
}

}  // namespace
}  // namespace taclink

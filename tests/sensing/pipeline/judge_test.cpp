#include "sensing/pipeline/judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class JudgeTest : public ::testing::Test {
 protected:
  JudgeTest() {
    const auto markers = static_cast<size_t>(model_.markers.count());
    state_.shape.sources.assign(markers, MarkerSource::kBoth);
    state_.shape.positions_mm = model_.RestMarkers();
    state_.forces.converged = true;
    estimate_.displacements_mm = estimate_.untouched_mm =
        Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(markers));
  }
  void Touch(double deg, double z_mm) {
    Contact contact;
    contact.center_mm = model_.PointAtDepth(deg * kPi / 180, z_mm, 0);
    state_.contacts.push_back(contact);
  }
  void Lose(int path, int ring) {
    const int paths = model_.markers.paths;
    state_.shape.sources[static_cast<size_t>(model_.MarkerIndex((path + paths) % paths, ring))] =
        MarkerSource::kInferred;
  }
  std::vector<ReasonId> Reasons() {
    Judge({.model = model_,
           .camera_trouble = camera_trouble_,
           .camera_warning = camera_warning_,
           .agreement = agreement_,
           .diagnosis = diagnosis_,
           .motion = motion_,
           .sees_alone = sees_alone_,
           .attitude = attitude_,
           .attitude_error_mm = attitude_error_mm_,
           .drift = {},
           .is_baseline_forced = is_baseline_forced_,
           .measured = measured_,
           .is_pressure_measured = is_pressure_measured_,
           .baseline = baseline_,
           .estimate = estimate_},
          state_);
    std::vector<ReasonId> ids;
    for (const Reason& reason : state_.reasons) {
      ids.push_back(reason.id);
      const size_t what_to_do = reason.text.find("; ");
      EXPECT_NE(what_to_do, std::string::npos) << "does not say what to do: " << reason.text;
    }
    return ids;
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  LinkState state_;
  SkinEstimate estimate_;
  std::optional<Reason> camera_trouble_, camera_warning_, diagnosis_;
  CameraAgreement agreement_;
  std::optional<MotionDisagreement> motion_;
  std::optional<CameraId> sees_alone_;
  std::optional<AttitudeDisagreement> attitude_;
  double attitude_error_mm_ = 0;
  bool is_pressure_measured_ = true, is_baseline_forced_ = false;
  MeasuredLoads measured_{.pressure_mpa = 1e-3, .pressure_sigma_mpa = 5e-5},
      baseline_{.pressure_mpa = 5e-4, .pressure_sigma_mpa = 5e-5};
};

TEST_F(JudgeTest, WhatIsWellIsOk) {
  Touch(20, 90);
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  EXPECT_EQ(state_.status, LinkStatus::kOk);
}

TEST_F(JudgeTest, AForcedBaselineIsNamedWhereItMayExplainWhatIsWrong) {
  is_baseline_forced_ = true;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  is_pressure_measured_ = false;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kPressureUnknown)) << "does not come of it";
  estimate_.failure = EstimateFailure::kNotConverged;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kNotConverged, ReasonId::kPressureUnknown,
                                                ReasonId::kForcedBaseline));
}

TEST_F(JudgeTest, CamerasThatDisagreeAreTold) {
  agreement_ = {.pairs = 200, .apart = 7};
  EXPECT_THAT(Reasons(), ::testing::IsEmpty()) << "wrong labels";
  agreement_ = {.pairs = 200, .apart = 9};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kCamerasDisagree));
  EXPECT_EQ(state_.reasons[0].value, 9);
  EXPECT_EQ(state_.reasons[0].limit, 8);
  agreement_ = {.pairs = 20, .apart = 3};
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  motion_ = MotionDisagreement{CameraId::kBottom};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kCamerasDisagree));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("bottom"));
  motion_.reset();
  sees_alone_ = CameraId::kTop;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kCamerasDisagree));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("the top camera shows the skin pressed"));
  motion_ = MotionDisagreement{CameraId::kTop, 0.23};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kLate));
  EXPECT_EQ(state_.reasons[0].value, 0.23);
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("top camera shows the skin's motion 0.23 s later"));
}

TEST_F(JudgeTest, PicturesOfTwoSkinsMeasureNothing) {
  agreement_ = {.pairs = 200, .apart = 21};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kCamerasDisagree));
  EXPECT_EQ(state_.status, LinkStatus::kLost);
  EXPECT_EQ(state_.reasons[0].limit, 20) << "from which nothing is measured";
  EXPECT_FALSE(state_.measured());
}

TEST_F(JudgeTest, ALagIsToldBesidePicturesOfTwoSkins) {
  agreement_ = {.pairs = 200, .apart = 21};
  motion_ = MotionDisagreement{CameraId::kTop, 0.5};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kCamerasDisagree, ReasonId::kLate));
}

TEST_F(JudgeTest, APressureThatNobodyTellsIsTold) {
  is_pressure_measured_ = false;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kPressureUnknown));
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("pressure_kpa"));
}

TEST_F(JudgeTest, ARingContactNearItsLimitIsDoubted) {
  Touch(0, 95);
  state_.contacts[0].is_ring_contact = true;
  state_.contacts[0].normal_force_n = 1;
  state_.forces.limit_around_n = 0.24;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  state_.forces.limit_around_n = 0.26;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kEncircled));
}

TEST_F(JudgeTest, ContactsAllAroundNearTheirLimitAreDoubted) {
  for (int body = 0; body < 6; ++body) {
    Touch(60 * body - 170, body % 2 == 0 ? 85 : 105);
    state_.contacts.back().normal_force_n = 0.2;
  }
  state_.forces.limit_around_n = 0.29;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  state_.forces.limit_around_n = 0.31;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kEncircled));
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  // A gap.
  state_.contacts.pop_back();
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
}

TEST_F(JudgeTest, BodiesAlongTheLinkAreNotAround) {
  for (int body = 0; body < 6; ++body) Touch(60 * body, 30 * (body + 1) - 5);
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
}

// What is known of its center does not tell on which side of the first ring it is.
TEST_F(JudgeTest, AContactThatMayBeBesideTheMarkersIsTold) {
  const double first_mm = model_.markers.rings_z_mm.front();
  Touch(20, first_mm + 4);
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  state_.contacts[0].center_covariance_mm2 = Mat3(2.5 * 2.5 * Mat3::Identity());
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kBeyondMarkers));
  state_.contacts[0].center_mm.z() = first_mm + 6;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
}

// Half of a plate that reaches the last ring may press where there are no markers.
TEST_F(JudgeTest, AWideContactThatReachesTheLastRingIsDoubted) {
  const double last_mm = model_.markers.rings_z_mm.back();
  Touch(20, last_mm - 18);
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  state_.contacts[0].major_axis_mm = 17 * Vec3::UnitZ();
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kBeyondMarkers));
  state_.contacts[0].center_mm.z() = last_mm - 22;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
}

// The last ring is not seen around it: what is told of it is told by the one before.
TEST_F(JudgeTest, AContactBesideMarkersThatAreLostIsTold) {
  const auto& rings_mm = model_.markers.rings_z_mm;
  const auto last = static_cast<size_t>(model_.markers.rings() - 1);
  Touch(0, rings_mm[last - 1] + 5);
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  const auto at = static_cast<int>(
      std::lround((0 - model_.markers.first_path_angle_rad) / model_.markers.path_pitch_rad()));
  for (int path = at - 1; path <= at + 1; ++path) Lose(path, static_cast<int>(last));
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kBeyondMarkers));
}

// A body may press where nothing is seen, without any contact told.
TEST_F(JudgeTest, SkinOutOfSightIsTold) {
  const int rings = model_.markers.rings(), paths = model_.markers.paths;
  for (int path = 0; path < paths; ++path) Lose(path, rings - 1);
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  for (int path = 0; path < paths; ++path) Lose(path, rings - 2);
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kSparseMarkers));
  state_.shape.sources.assign(static_cast<size_t>(model_.markers.count()), MarkerSource::kBoth);
  // What a body hides, which its surroundings tell.
  for (int path = 3; path < 6; ++path) {
    for (int ring = 4; ring < 7; ++ring) Lose(path, ring);
  }
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  for (int path = 0; path < 10; ++path) {
    for (int ring = 4; ring < 7; ++ring) Lose(path, ring);
  }
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kSparseMarkers));
}

TEST_F(JudgeTest, APressureThatDoesNotFitIsTold) {
  state_.pressure_estimate = {.mpa = 1.14e-3, .sigma_mpa = 5e-5};
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  state_.pressure_estimate->mpa = 1.16e-3;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kPressureMismatch));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("1.160 kPa, the sensor 1.000 kPa"));
}

TEST_F(JudgeTest, ABaselinesPressureThatDoesNotFitIsTold) {
  state_.pressure_estimate = {.mpa = 1e-3, .sigma_mpa = 5e-5};
  estimate_.loads.baseline_error[0] = -1.4e-4;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  estimate_.loads.baseline_error[0] = -1.6e-4;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kPressureMismatch));
  EXPECT_THAT(
      state_.status_reason,
      ::testing::HasSubstr("0.340 kPa when the baseline was taken; measured were 1.000 and 0.500 kPa"));
}

TEST_F(JudgeTest, AModulusThatDoesNotFitIsTold) {
  baseline_.pressure_mpa = 0;
  measured_.pressure_mpa = 3e-4;
  state_.pressure_estimate = {.mpa = 3.2e-4, .sigma_mpa = 3e-6};
  state_.forces.converged = true;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  state_.pressure_estimate->mpa = 3.3e-4;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kStiffnessMismatch));
  char text[800];
  std::snprintf(text, sizeof text,
                "10 %% more than a pressure change of +0.300 kPa explains with the model's Young's modulus "
                "of %.4f MPa; the modulus may be %.4f",
                model_.material.youngs_modulus_mpa, model_.material.youngs_modulus_mpa / 1.1);
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr(text));
  // The sensor's offset is in both.
  estimate_.loads.baseline_error[0] = 3e-5;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  // Of a change that is hardly measured nothing follows.
  measured_.pressure_mpa = 9e-5;
  state_.pressure_estimate->mpa = 1.2e-4;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
}

TEST_F(JudgeTest, AnAttitudeThatDoesNotFitIsTold) {
  measured_.specific_force_covariance = baseline_.specific_force_covariance = 0.04 * Mat3::Identity();
  // Of the change since the baseline: 3 sqrt(0.08) is 0.85.
  estimate_.loads.known_error[1] = 0.4;
  estimate_.loads.baseline_error[1] = -0.4;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  estimate_.loads.baseline_error[1] = -0.5;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kAttitudeMismatch));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("by 3.2 standard deviations"));
  estimate_.loads.baseline_error[1] = 0.4;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty()) << "it has not changed";
  attitude_ = {.skin_mps2 = {0, -9.81, 0}, .measured_mps2 = {0, 0, -9.81}, .deviations = 7, .angle_deg = 31};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kAttitudeMismatch));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("31 deg off"));
}

TEST_F(JudgeTest, AnAttitudeThatIsHardlyKnownIsTold) {
  attitude_error_mm_ = 0.19;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  attitude_error_mm_ = 0.21;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kAttitudeUnknown));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("UpdateAttitude"));
  state_.specific_force = SpecificForceReading{.trouble = "the joint states are stale: send them"};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kAttitudeUnknown));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("joint states are stale"));
}

TEST_F(JudgeTest, MarkersThatContradictAreTold) {
  state_.forces.region_residual = 5.1;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kResidual));
  state_.forces.region_residual = 1;
  state_.forces.residual = 1.3;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kResidual));
}

TEST_F(JudgeTest, CamerasThatMovedAreTold) {
  estimate_.loads.camera_shift_mm = 0.49;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  estimate_.loads.camera_shift_mm = 0.51;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kCamerasMoved));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("0.51 mm"));
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
}

TEST_F(JudgeTest, ATangentThatIsFarFromTheSkinIsTold) {
  estimate_.first_order_mm = 0.59;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  estimate_.first_order_mm = 0.61;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kForceModel));
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
}

TEST_F(JudgeTest, ASkinThatBucklesUnseenIsTold) {
  estimate_.unsettled_mm = 1.2;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kUnsettled));
}

// Far from each other, so that no neighbors are left out together.
TEST_F(JudgeTest, ManyMarkersThatWereLeftOutAreTold) {
  for (int k = 0; k < 20; ++k) state_.shape.rejected.push_back({CameraId::kTop, 11 * k});
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kLabels));
  state_.shape.rejected.resize(19);
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
}

TEST_F(JudgeTest, WhatHasNoAnswerHasNoForces) {
  estimate_.failure = EstimateFailure::kNotConverged;
  state_.forces.converged = false;
  Touch(20, 90);
  state_.forces.forces_n.assign(state_.shape.sources.size(), Vec3(0, 0, 1));
  state_.forces.loaded = {20};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kNotConverged));
  EXPECT_THAT(state_.contacts, ::testing::IsEmpty());
  EXPECT_THAT(state_.forces.forces_n, ::testing::Each(Vec3(0, 0, 0)));
  EXPECT_THAT(state_.forces.loaded, ::testing::IsEmpty());
}

TEST_F(JudgeTest, FewMarkersAreALostLink) {
  for (size_t m = 0; m < 150; ++m) state_.shape.sources[m] = MarkerSource::kInferred;
  EXPECT_THAT(Reasons(), ::testing::Contains(ReasonId::kFewMarkers));
  EXPECT_EQ(state_.status, LinkStatus::kLost);
}

TEST_F(JudgeTest, ACauseComesBeforeWhatItDoes) {
  diagnosis_ = Reason{ReasonId::kCamerasSwapped, "exchanged; put them right"};
  for (int ring = 0; ring < 7; ++ring)
    for (int path = 0; path < model_.markers.paths; ++path) Lose(path, ring);
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kCamerasSwapped, ReasonId::kFewMarkers));
  EXPECT_EQ(state_.status, LinkStatus::kLost);
  EXPECT_EQ(state_.status_reason, "exchanged; put them right");
}

TEST_F(JudgeTest, LostContrastIsNamed) {
  state_.cameras[Index(CameraId::kBottom)].contrast = 0.5;
  EXPECT_THAT(Reasons(), ::testing::IsEmpty());
  state_.cameras[Index(CameraId::kBottom)].contrast = 0.3;
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kImageContrast));
  EXPECT_THAT(state_.status_reason, ::testing::HasSubstr("bottom camera's images markers have 30 %"));
}

TEST_F(JudgeTest, AFrameRateThatDiffersDegrades) {
  camera_warning_ = Reason{ReasonId::kFrameRate, "half of them; set it"};
  EXPECT_THAT(Reasons(), ::testing::ElementsAre(ReasonId::kFrameRate));
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
}

}  // namespace
}  // namespace taclink

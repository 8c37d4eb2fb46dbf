#include "server/arm/arm_contacts.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "tests/server/arm/arms.h"
#include "tests/server/support.h"
#include "tests/support/times.h"

namespace taclink::server {
namespace {

Contact MakeContact() {
  Contact contact;
  contact.id = 5;
  contact.center_mm = Vec3(36, 4, 90);
  contact.normal = Vec3(1, 0, 0);
  contact.force_n = Vec3(-2, 0.5, 1);
  contact.force_covariance_n2 = Mat3{{0.04, 0.01, 0}, {0.01, 0.02, 0}, {0, 0, 0.09}};
  contact.center_covariance_mm2 = Mat3{{1, 0.2, 0}, {0.2, 2, 0}, {0, 0, 3}};
  contact.normal_force_n = 2;
  contact.area_mm2 = 120;
  return contact;
}

LinkState StateAt(int64_t exposure_ns) {
  LinkState state;
  state.sequence = 9;
  state.status = LinkStatus::kOk;
  state.times.exposure_monotonic_ns = exposure_ns;
  state.contacts = {MakeContact()};
  return state;
}

/// Two links: one on a joint-moved frame with a mount of its own, one on the base.
class ArmContactsTest : public ::testing::Test {
 protected:
  ArmContactsTest() {
    poses_ = std::make_unique<ArmPoses>(
        kinematics_,
        std::vector<LinkMount>{{.frame = *kinematics_->FindFrame("tip"), .frame_from_link = kTipFromLink},
                               {.frame = {}, .frame_from_link = {Mat3::Identity(), Vec3(1, 2, 3)}}});
  }
  void Joints(int64_t time_ns, std::vector<double> positions) {
    const std::vector<size_t> all = {0, 1, 2};
    EXPECT_TRUE(poses_->joints()
                    .Add({.time_ns = time_ns, .joints = all, .positions = positions, .velocities = {}})
                    .ok());
  }
  Rigid3 TipAt(const std::vector<double>& q) const {
    return kinematics_->BaseFromFrame(*kinematics_->FindFrame("tip"), q);
  }

  const Rigid3 kTipFromLink = {Eigen::AngleAxisd(0.8, Vec3(1, 2, 3).normalized()).toRotationMatrix(),
                               Vec3(10, -20, 30)};
  const std::shared_ptr<const ArmKinematics> kinematics_ = *ArmKinematics::Parse("arm.urdf", kThreeJointArm);
  std::unique_ptr<ArmPoses> poses_;
};

// At the exposure, not now: the joints go on moving.
TEST_F(ArmContactsTest, ContactsAreWhereTheArmWasAtTheExposure) {
  Joints(1000 * kMs, {0.2, 0.1, -0.4});
  Joints(1100 * kMs, {0.6, 0.3, 0.4});
  Joints(1500 * kMs, {1.5, 0.4, 1.4});
  const auto arm = ToArm(0, StateAt(1050 * kMs), *poses_);
  EXPECT_EQ(arm.pose.validity, PoseValidity::kInterpolated);
  EXPECT_EQ(arm.pose.distance_ns, 50 * kMs);
  ASSERT_EQ(arm.contacts.size(), 1u);
  const Rigid3 base_from_tip = TipAt({0.4, 0.2, 0});
  const ArmContact& contact = arm.contacts[0];
  const Contact link = MakeContact();
  const Mat3 rotation = base_from_tip.rotation * kTipFromLink.rotation;
  EXPECT_NEAR((contact.center_mm - base_from_tip * (kTipFromLink * link.center_mm)).norm(), 0, 1e-9);
  EXPECT_NEAR((contact.normal - rotation * link.normal).norm(), 0, 1e-12);
  EXPECT_NEAR((contact.force_n - rotation * link.force_n).norm(), 0, 1e-12);
  EXPECT_NEAR((contact.moment_nmm - contact.center_mm.cross(contact.force_n)).norm(), 0, 1e-9);
  EXPECT_NEAR(
      (*contact.force_covariance_n2 - rotation * *link.force_covariance_n2 * rotation.transpose()).norm(), 0,
      1e-12);
  EXPECT_EQ(contact.link_id, 5u);
  EXPECT_EQ(contact.normal_force_n, 2);
}

TEST_F(ArmContactsTest, IdsAreUniqueOverTheArm) {
  EXPECT_EQ(ToArm(1, StateAt(1), *poses_).contacts[0].id, (uint64_t{1} << 40) + 5);
  EXPECT_NE(ToArm(0, StateAt(1), *poses_).contacts[0].id, ToArm(1, StateAt(1), *poses_).contacts[0].id);
  EXPECT_EQ(ToArm(1, StateAt(1), *poses_).contacts[0].id, ToArm(1, StateAt(99), *poses_).contacts[0].id);
}

TEST_F(ArmContactsTest, ALinkOnTheBaseIsFixed) {
  const auto arm = ToArm(1, StateAt(50), *poses_);
  EXPECT_EQ(arm.pose.validity, PoseValidity::kFixed);
  EXPECT_NEAR((arm.contacts[0].center_mm - Vec3(37, 6, 93)).norm(), 0, 1e-12);
  for (const JointLoad& load : arm.joints) {
    EXPECT_EQ(load.torque_nm, 0);
    EXPECT_TRUE(load.variance_known);
  }
}

TEST_F(ArmContactsTest, WithoutJointStatesThePoseIsUnknownAndLaterStale) {
  EXPECT_EQ(ToArm(0, StateAt(1000 * kMs), *poses_).pose.validity, PoseValidity::kUnknown);
  Joints(1000 * kMs, {0, 0, 0});
  EXPECT_EQ(ToArm(0, StateAt(1010 * kMs), *poses_).pose.validity, PoseValidity::kExtrapolated);
  EXPECT_EQ(ToArm(0, StateAt(1300 * kMs), *poses_).pose.validity, PoseValidity::kStale);
}

// Virtual work: the force's work on the point's small motion is the torque's work on the joint's.
TEST_F(ArmContactsTest, TorquesDoTheWorkOfTheForces) {
  const std::vector<double> q = {0.7, 0.3, -1.1};
  Joints(1000 * kMs, q);
  LinkState state = StateAt(1000 * kMs);
  state.contacts.push_back(MakeContact());
  state.contacts[1].center_mm = Vec3(-30, 20, 10);
  state.contacts[1].force_n = Vec3(1, -3, 0.2);
  const auto arm = ToArm(0, state, *poses_);
  ASSERT_EQ(arm.joints.size(), 3u);
  const double step = 1e-5;
  for (size_t joint = 0; joint < 3; ++joint) {
    auto more = q, less = q;
    more[joint] += step;
    less[joint] -= step;
    double work_nmm = 0;
    for (size_t i = 0; i < 2; ++i) {
      const Vec3 p_in_tip = kTipFromLink * state.contacts[i].center_mm;
      work_nmm += arm.contacts[i].force_n.dot(TipAt(more) * p_in_tip - TipAt(less) * p_in_tip);
    }
    EXPECT_NEAR(arm.joints[joint].torque_nm, 1e-3 * work_nmm / (2 * step), 1e-7);
    EXPECT_GT(std::abs(arm.joints[joint].torque_nm), 1e-3);
  }
}

// The variance against small changes of force and place along their principal directions.
TEST_F(ArmContactsTest, TorqueVarianceFollowsFromForceAndPlace) {
  Joints(1000 * kMs, {0.7, 0.3, -1.1});
  const LinkState state = StateAt(1000 * kMs);
  const auto arm = ToArm(0, state, *poses_);
  for (size_t joint = 0; joint < 3; ++joint) {
    double variance = 0;
    for (const bool place : {false, true}) {
      const Contact& contact = state.contacts[0];
      const Eigen::SelfAdjointEigenSolver<Mat3> principal(place ? *contact.center_covariance_mm2
                                                                : *contact.force_covariance_n2);
      for (int axis = 0; axis < 3; ++axis) {
        LinkState changed = state;
        const Vec3 step = std::sqrt(principal.eigenvalues()[axis]) * principal.eigenvectors().col(axis);
        (place ? changed.contacts[0].center_mm : changed.contacts[0].force_n) += step;
        const double change =
            ToArm(0, changed, *poses_).joints[joint].torque_nm - arm.joints[joint].torque_nm;
        variance += change * change;
      }
    }
    EXPECT_TRUE(arm.joints[joint].variance_known);
    EXPECT_NEAR(arm.joints[joint].variance_nm2, variance, 1e-9);
    EXPECT_GT(variance, 0);
  }
  LinkState without = state;
  without.contacts[0].force_covariance_n2.reset();
  EXPECT_FALSE(ToArm(0, without, *poses_).joints[0].variance_known);
}

TEST_F(ArmContactsTest, LoadsOfLinksAdd) {
  std::vector<JointLoad> arm;
  AddLoads({{.torque_nm = 1, .variance_nm2 = 4}, {.torque_nm = 2}}, arm);
  AddLoads({{.torque_nm = -3, .variance_nm2 = 5}, {.torque_nm = 2, .variance_known = false}}, arm);
  ASSERT_EQ(arm.size(), 2u);
  EXPECT_EQ(arm[0].torque_nm, -2);
  EXPECT_EQ(arm[0].variance_nm2, 9);
  EXPECT_TRUE(arm[0].variance_known);
  EXPECT_FALSE(arm[1].variance_known);
}

TEST_F(ArmContactsTest, APublicationIsComputedOnce) {
  Hub hub(2, [](size_t, const LinkState&, Detail) { return std::string(); });
  ArmContacts contacts(*poses_);
  hub.Publish(0, std::make_shared<const LinkState>(StateAt(1000 * kMs)));
  const auto first = hub.Latest(0);
  const auto of_first = contacts.Of(*first);
  EXPECT_EQ(contacts.Of(*first), of_first);
  hub.Publish(0, std::make_shared<const LinkState>(StateAt(2000 * kMs)));
  const auto of_second = contacts.Of(*hub.Latest(0));
  EXPECT_EQ(of_second->times.exposure_monotonic_ns, 2000 * kMs);
  EXPECT_EQ(contacts.Of(*first)->times.exposure_monotonic_ns, 1000 * kMs) << "asked late";
  EXPECT_EQ(contacts.Of(*hub.Latest(0)), of_second);
}

}  // namespace
}  // namespace taclink::server

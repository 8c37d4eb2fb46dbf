// Contacts of the whole arm over gRPC, with joints that clients tell.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "client/cpp/taclink/arm_contacts.h"
#include "tests/integration/support.h"
#include "tests/server/arm/arms.h"
#include "tests/support/times.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

const Rigid3 kWristFromLink = {Eigen::AngleAxisd(0.5, Vec3::UnitX()).toRotationMatrix(), Vec3(0, 10, 20)};

Vec3 ToVec3(const v1::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

v1::UpdateJointStatesRequest States(const std::vector<std::string>& names,
                                    const std::vector<double>& positions, int64_t utc_ns) {
  v1::UpdateJointStatesRequest states;
  states.mutable_names()->Assign(names.begin(), names.end());
  states.mutable_positions()->Assign(positions.begin(), positions.end());
  states.set_utc_ns(utc_ns);
  return states;
}

/// "upper" on the wrist of a two-joint arm, "lower" on the base.
class ArmTest : public ::testing::Test {
 protected:
  ArmTest() : kinematics_(*ArmKinematics::Parse("arm.urdf", kTwoJointArm)) {
    auto poses = std::make_unique<ArmPoses>(
        kinematics_,
        std::vector<LinkMount>{{.frame = *kinematics_->FindFrame("wrist"), .frame_from_link = kWristFromLink},
                               {.frame = {}, .frame_from_link = {Mat3::Identity(), Vec3(0, 0, 250)}}});
    server_ = std::make_unique<TestServer>(TestLimits(), std::move(poses));
    connection_ = std::make_unique<client::Client>(server_->Connect());
  }

  std::unique_ptr<client::ContactReader> Contacts(double rate_hz = 0) {
    auto reader = connection_->StreamContacts(rate_hz);
    EXPECT_TRUE(reader.ok()) << reader.error().message;
    return reader.ok() ? std::move(*reader) : nullptr;
  }
  v1::StreamContactsResponse NextOf(client::ContactReader& reader) {
    auto contacts = reader.Next(kForever);
    EXPECT_TRUE(contacts.ok()) << contacts.error().message;
    return contacts.ok() ? std::move(*contacts) : v1::StreamContactsResponse{};
  }
  /// Tells the joints at a time from now and waits until the server has them.
  void Joints(const std::vector<double>& positions, milliseconds from_now = milliseconds(0)) {
    const auto writer = connection_->UpdateJointStates();
    const int64_t utc_ns = server_->clock().UtcNs() + std::chrono::nanoseconds(from_now).count();
    EXPECT_TRUE(writer->Write(States({"shoulder", "elbow"}, positions, utc_ns)).ok());
    const auto summary = writer->Finish();
    EXPECT_TRUE(summary.ok()) << summary.error().message;
    if (summary.ok()) {
      EXPECT_EQ(summary->accepted(), 1u);
    }
  }
  int64_t Now() { return server_->clock().MonotonicNs(); }

  const std::shared_ptr<const ArmKinematics> kinematics_;
  std::unique_ptr<TestServer> server_;
  std::unique_ptr<client::Client> connection_;
};

TEST_F(ArmTest, ContactsAreInTheBaseFrame) {
  Joints({0.2, -0.4}, milliseconds(-100));
  Joints({0.6, 0.4});
  server_->Publish(0, 5, Now() - 40 * kMs, Now() - 50 * kMs);
  server_->Publish(1, 8, Now() - 40 * kMs, Now() - 50 * kMs);
  const auto reader = Contacts();
  const auto arm = NextOf(*reader);
  EXPECT_EQ(arm.sequence(), 1u);
  ASSERT_EQ(arm.contacts_size(), 2);
  ASSERT_EQ(arm.links_size(), 2);
  EXPECT_EQ(arm.links(0).validity(), v1::POSE_VALIDITY_INTERPOLATED);
  EXPECT_NEAR(arm.links(0).joint_state_distance_s(), 0.05, 1e-9);
  EXPECT_EQ(arm.links(0).sequence(), 5u);
  EXPECT_EQ(arm.links(1).validity(), v1::POSE_VALIDITY_FIXED);

  // The pose by hand: joints halfway, and the link's place on the wrist.
  const double q0 = 0.4, q01 = 0.4;
  const Mat3 turned = Eigen::AngleAxisd(q01, Vec3::UnitZ()).toRotationMatrix();
  const Mat3 base_from_link =
      turned * Eigen::AngleAxisd(kPi / 2, Vec3::UnitX()).toRotationMatrix() * kWristFromLink.rotation;
  const Vec3 wrist_mm = Vec3(300 * std::cos(q0), 300 * std::sin(q0), 100) + turned * Vec3(250, 0, 0);
  LinkState state;
  FillTestState(0, 5, state);
  const Contact& contact = state.contacts[0];
  const Vec3 center_mm =
      wrist_mm +
      turned * Eigen::AngleAxisd(kPi / 2, Vec3::UnitX()).toRotationMatrix() * kWristFromLink.translation +
      base_from_link * contact.center_mm;
  const Vec3 force_n = base_from_link * contact.force_n;
  const v1::ArmContact& streamed = arm.contacts(0);
  EXPECT_EQ(streamed.id(), contact.id);
  EXPECT_EQ(streamed.link(), "upper");
  EXPECT_NEAR((1e3 * ToVec3(streamed.center_m()) - center_mm).norm(), 0, 1e-9);
  EXPECT_NEAR((ToVec3(streamed.wrench().force_n()) - force_n).norm(), 0, 1e-12);
  EXPECT_NEAR((ToVec3(streamed.normal()) - base_from_link * contact.normal).norm(), 0, 1e-12);
  EXPECT_NEAR((ToVec3(streamed.wrench().moment_nm()) - 1e-3 * center_mm.cross(force_n)).norm(), 0, 1e-12);
  EXPECT_TRUE(streamed.force_covariance_n2().empty());
  EXPECT_EQ(streamed.validity(), v1::POSE_VALIDITY_INTERPOLATED);
  EXPECT_EQ(arm.contacts(1).link(), "lower");
  EXPECT_EQ(arm.contacts(1).id(), (uint64_t{1} << 40) + contact.id);
  EXPECT_NEAR(arm.contacts(1).center_m().z(), 0.258, 1e-12);
  ASSERT_TRUE(arm.has_total());
  EXPECT_NEAR(arm.total().force_n().y(), streamed.wrench().force_n().y(), 1e-12) << "lower's is along x";

  // Of upper's contact only, about the two vertical axes.
  ASSERT_EQ(arm.joint_torques_size(), 2);
  EXPECT_EQ(arm.joint_names(1), "elbow");
  const Vec3 elbow_mm(300 * std::cos(q0), 300 * std::sin(q0), 100);
  EXPECT_NEAR(arm.joint_torques(0), 1e-3 * center_mm.cross(force_n).z(), 1e-12);
  EXPECT_NEAR(arm.joint_torques(1), 1e-3 * (center_mm - elbow_mm).cross(force_n).z(), 1e-12);
  EXPECT_TRUE(arm.joint_torque_sigmas().empty()) << "no covariance, no sigma";
}

TEST_F(ArmTest, EveryPublicationIsToldAndJointsThatStopAreStale) {
  const auto reader = Contacts();
  auto arm = NextOf(*reader);
  EXPECT_TRUE(arm.contacts().empty()) << "sent at once, before any link has published";
  EXPECT_EQ(arm.validity(), v1::POSE_VALIDITY_FIXED);
  EXPECT_EQ(arm.links(0).status(), v1::LINK_STATUS_STARTING);
  EXPECT_FALSE(arm.has_total()) << "a sum over nothing is no zero";
  EXPECT_TRUE(arm.joint_torques().empty());
  server_->Publish(0, 1, Now(), Now());
  EXPECT_EQ(NextOf(*reader).validity(), v1::POSE_VALIDITY_UNKNOWN);
  Joints({0.1, 0.2});
  server_->Publish(0, 2, Now(), Now());
  EXPECT_EQ(NextOf(*reader).validity(), v1::POSE_VALIDITY_INTERPOLATED);
  server_->Publish(0, 3, Now() + 40 * kMs, Now() + 40 * kMs);
  EXPECT_EQ(NextOf(*reader).validity(), v1::POSE_VALIDITY_EXTRAPOLATED);
  server_->Publish(0, 4, Now() + 900 * kMs, Now() + 900 * kMs);
  arm = NextOf(*reader);
  EXPECT_EQ(arm.validity(), v1::POSE_VALIDITY_STALE);
  EXPECT_NEAR(arm.contacts(0).center_m().x(), 0.3 * std::cos(0.1) + 0.25 * std::cos(0.3), 0.08);
  EXPECT_EQ(arm.sequence(), 5u);
}

TEST_F(ArmTest, RateLimitLeavesOutMessages) {
  const auto reader = Contacts(10);
  EXPECT_EQ(NextOf(*reader).sequence(), 1u);
  std::vector<uint64_t> frames;
  for (uint64_t i = 1; i <= 9; ++i) {
    server_->Publish(0, i, static_cast<int64_t>(i) * 1'000'000'000 / 30);
    const auto next = reader->Next(milliseconds(i % 3 == 1 ? kForever : milliseconds(30)));
    if (next) frames.push_back(next->links(0).sequence());
  }
  EXPECT_THAT(frames, ::testing::ElementsAre(1, 4, 7));
}

TEST_F(ArmTest, BadRequestsAndJointStatesAreRefusedWithTheReason) {
  const auto reader = connection_->StreamContacts(-1);
  ASSERT_FALSE(reader.ok());
  EXPECT_EQ(reader.error().code, ErrorCode::kInvalidArgument);
  const auto complaint = [&](const v1::UpdateJointStatesRequest& states) {
    const auto writer = connection_->UpdateJointStates();
    if (const auto written = writer->Write(states); !written) return written.error();
    const auto end = writer->Finish();
    return end ? Error{ErrorCode::kInternal, "accepted"} : end.error();
  };
  const int64_t now = server_->clock().UtcNs();
  const auto unknown = complaint(States({"knee"}, {0.1}, now));
  EXPECT_EQ(unknown.code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(unknown.message, HasSubstr("no joint 'knee'; there are: shoulder, elbow"));
  EXPECT_THAT(complaint(States({"elbow"}, {std::numeric_limits<double>::quiet_NaN()}, now)).message,
              HasSubstr("message 1 of this call: positions must be a finite number"));
  EXPECT_THAT(complaint(States({"elbow"}, {1, 2}, now)).message, HasSubstr("2 positions for 1 joints"));
  EXPECT_THAT(complaint(States({"elbow"}, {1}, 0)).message, HasSubstr("no time"));

  const auto writer = connection_->UpdateJointStates();
  EXPECT_TRUE(writer->Write(States({"elbow"}, {0.1}, now)).ok());
  static_cast<void>(writer->Write(States({}, {0.2}, now - 50 * kMs)));
  const auto end = writer->Finish();
  ASSERT_FALSE(end.ok());
  EXPECT_THAT(end.error().message, ::testing::AnyOf(HasSubstr("before that of the message before"),
                                                    HasSubstr("the call has ended")));
  const auto arm = connection_->GetArm();
  ASSERT_TRUE(arm.ok());
  EXPECT_NEAR(arm->joints(1).position(), 0.1, 1e-12) << "what came before stays";
}

TEST_F(ArmTest, GetArmTellsJointsAndPosesNow) {
  auto arm = connection_->GetArm();
  ASSERT_TRUE(arm.ok()) << arm.error().message;
  EXPECT_EQ(arm->base_frame(), "world");
  ASSERT_EQ(arm->joints_size(), 2);
  EXPECT_EQ(arm->joints(0).name(), "shoulder");
  EXPECT_EQ(arm->joints(0).lower(), -2);
  EXPECT_FALSE(arm->joints(1).has_upper());
  EXPECT_FALSE(arm->joints(0).has_position());
  EXPECT_NEAR(arm->links(0).base_from_link().translation_m().x(), 0.55, 1e-12);
  Joints({kPi / 2, 0});
  arm = connection_->GetArm();
  ASSERT_TRUE(arm.ok());
  EXPECT_NEAR(arm->joints(0).position(), kPi / 2, 1e-12);
  EXPECT_NEAR(arm->links(0).base_from_link().translation_m().y(), 0.55, 1e-12);
  EXPECT_NEAR(arm->links(1).base_from_link().translation_m().z(), 0.25, 1e-12);
}

TEST_F(ArmTest, BodiesMoveWithTheJoints) {
  const auto arm = connection_->GetArm();
  ASSERT_TRUE(arm.ok()) << arm.error().message;
  ASSERT_EQ(arm->visuals_size(), 1);
  EXPECT_EQ(arm->visuals(0).frame(), "wrist");
  EXPECT_EQ(arm->visuals(0).shape(), v1::VISUAL_SHAPE_BOX);
  EXPECT_NEAR(arm->visuals(0).size_m().z(), 0.02, 1e-12);
  EXPECT_NEAR(arm->visuals(0).frame_from_visual().translation_m().z(), 0.01, 1e-12);
  EXPECT_NEAR(arm->visuals(0).base_from_frame().translation_m().x(), 0.55, 1e-12);
  Joints({kPi / 2, 0});
  server_->Publish(0, 5, Now(), Now());
  const auto contacts = NextOf(*Contacts());
  ASSERT_EQ(contacts.frame_poses_size(), 1);
  EXPECT_EQ(contacts.frame_poses(0).frame(), "wrist");
  EXPECT_NEAR(contacts.frame_poses(0).base_from_frame().translation_m().y(), 0.55, 1e-12);
}

// Contacts are where the link was at their exposure; for drawing, all links are where they are at the newest
// one.
TEST_F(ArmTest, LinksWithOlderFramesAreDrawnWithTheOthers) {
  Joints({0, 0}, milliseconds(-100));
  Joints({kPi / 2, 0});
  server_->Publish(0, 5, Now() - 40 * kMs, Now() - 50 * kMs);
  server_->Publish(1, 8, Now(), Now());
  const auto contacts = NextOf(*Contacts());
  ASSERT_EQ(contacts.links_size(), 2);
  // Turned by half a right angle, with the link's 20 mm beside the wrist.
  EXPECT_NEAR(contacts.links(0).base_from_link().translation_m().y(), (0.55 - 0.02) * std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(contacts.links(0).drawn_base_from_link().translation_m().y(), 0.55, 1e-12);
  EXPECT_NEAR(contacts.links(1).drawn_base_from_link().translation_m().z(), 0.25, 1e-12);
}

TEST_F(ArmTest, CallsEndWithTheServer) {
  const auto reader = Contacts();
  NextOf(*reader);
  const auto writer = connection_->UpdateJointStates();
  EXPECT_TRUE(writer->Write(States({"elbow"}, {0.1}, server_->clock().UtcNs())).ok());
  server_->Publish(0, 1, Now(), Now());  // the server has the call when this has gone round
  NextOf(*reader);
  server_->Stop();
  const auto next = reader->Next(kForever);
  ASSERT_FALSE(next.ok());
  EXPECT_EQ(next.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(writer->Finish().error().code, ErrorCode::kUnavailable);
}

TEST_F(ArmTest, OnlySoManyMayFeedTheServer) {
  std::vector<std::unique_ptr<client::JointStateWriter>> writers;
  for (int i = 1; i <= 8; ++i) {
    server_->clock().Advance(milliseconds(1));
    writers.push_back(connection_->UpdateJointStates());
    EXPECT_TRUE(writers.back()->Write(States({"elbow"}, {0.01 * i}, server_->clock().UtcNs())).ok());
    while (connection_->GetArm()->joints(1).position() != 0.01 * i) {
    }
  }
  const auto refused = connection_->UpdateJointStates()->Finish();
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kResourceExhausted);
  EXPECT_THAT(refused.error().message, HasSubstr("all 8 calls"));
  for (const auto& writer : writers) EXPECT_EQ(writer->Finish()->accepted(), 1u);
}

TEST(ArmWithoutUrdf, HasContactsButNoJoints) {
  TestServer server;
  auto connection = server.Connect();
  server.Publish(1, 3);
  const auto reader = connection.StreamContacts();
  ASSERT_TRUE(reader.ok()) << reader.error().message;
  const auto arm = (*reader)->Next(kForever);
  ASSERT_TRUE(arm.ok());
  EXPECT_TRUE(arm->joint_torques().empty());
  ASSERT_EQ(arm->contacts_size(), 1);
  EXPECT_EQ(arm->validity(), v1::POSE_VALIDITY_FIXED);
  EXPECT_NEAR(arm->contacts(0).center_m().z(), 0.253, 1e-12);
  const auto writer = connection.UpdateJointStates();
  static_cast<void>(writer->Write(States({"a"}, {0}, 1)));
  const auto end = writer->Finish();
  ASSERT_FALSE(end.ok());
}

}  // namespace
}  // namespace taclink::server

#include "server/arm/arm_kinematics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <random>

#include "tests/server/arm/arms.h"

// urdfdom leaks what it has read of a file that it refuses. Read by the leak sanitizer, if there is one.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:liburdfdom_model";
}

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

using Transform = Eigen::Isometry3d;  // m

Transform Origin(double x, double y, double z, double roll = 0, double pitch = 0, double yaw = 0) {
  Transform out = Transform::Identity();
  out.translate(Vec3(x, y, z));
  out.rotate(Eigen::AngleAxisd(yaw, Vec3::UnitZ()) * Eigen::AngleAxisd(pitch, Vec3::UnitY()) *
             Eigen::AngleAxisd(roll, Vec3::UnitX()));
  return out;
}
Transform Turn(double angle, const Vec3& axis) {
  return Transform(Eigen::AngleAxisd(angle, axis.normalized()));
}

Transform WristByHand(const std::vector<double>& q) {
  return Origin(0, 0, 0.1) * Turn(q[0], Vec3::UnitZ()) * Origin(0.3, 0, 0) * Turn(q[1], Vec3::UnitZ()) *
         Origin(0.25, 0, 0, kPi / 2);
}
Transform TipByHand(const std::vector<double>& q) {
  return Origin(0.1, 0.2, 0.3, 0.4, -0.5, 0.6) * Turn(q[0], Vec3::UnitY()) * Origin(0.05, 0, 0.4, 0, 0.3) *
         Eigen::Translation3d(0, 0, q[1]) * Origin(0, 0.02, 0.1, 0.2, 0, -0.7) * Turn(q[2], Vec3(1, 1, 0));
}
Transform ThumbByHand(const std::vector<double>& q) {
  const double grip = -0.5 * q[1] + 0.03;
  return TipByHand(q) * Origin(0.01 + grip, 0, 0.05) * Origin(0, 0, 0.02) *
         Turn(3 * grip + 0.1, Vec3::UnitY());
}

std::shared_ptr<const ArmKinematics> Arm(const char* urdf, const std::string& base = "") {
  auto arm = ArmKinematics::Parse("arm.urdf", urdf, base);
  EXPECT_TRUE(arm.ok()) << arm.error().message;
  return arm.ok() ? *arm : nullptr;
}

void ExpectSame(const Rigid3& actual, const Transform& expected) {
  EXPECT_NEAR((actual.translation - 1e3 * expected.translation()).norm(), 0, 1e-9);
  EXPECT_NEAR((actual.rotation - expected.linear()).norm(), 0, 1e-12);
}

size_t FrameOf(const ArmKinematics& arm, const std::string& name) {
  const auto frame = arm.FindFrame(name);
  EXPECT_TRUE(frame.ok());
  return frame.ok() ? *frame : 0;
}

TEST(ArmKinematics, FramesAreWhereTheyAreByHand) {
  const auto two = Arm(kTwoJointArm), three = Arm(kThreeJointArm);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> some(-1.5, 1.5);
  for (int i = 0; i < 20; ++i) {
    const std::vector<double> q = {some(random), some(random), some(random)};
    ExpectSame(two->BaseFromFrame(FrameOf(*two, "wrist"), {q.data(), 2}), WristByHand(q));
    ExpectSame(three->BaseFromFrame(FrameOf(*three, "tip"), q), TipByHand(q));
    ExpectSame(three->BaseFromFrame(FrameOf(*three, "thumb"), q), ThumbByHand(q));
    ExpectSame(three->BaseFromFrame(FrameOf(*three, "root"), q), Transform::Identity());
  }
}

// Also where joints lie between the root and the base, which are then passed backwards.
TEST(ArmKinematics, AnyFrameCanBeTheBase) {
  const auto arm = Arm(kThreeJointArm, "b");
  EXPECT_EQ(arm->base(), "b");
  const std::vector<double> q = {0.4, 0.2, -0.9};
  const Transform root_from_b = Origin(0.1, 0.2, 0.3, 0.4, -0.5, 0.6) * Turn(q[0], Vec3::UnitY()) *
                                Origin(0.05, 0, 0.4, 0, 0.3) * Eigen::Translation3d(0, 0, q[1]);
  ExpectSame(arm->BaseFromFrame(FrameOf(*arm, "tip"), q), root_from_b.inverse() * TipByHand(q));
  ExpectSame(arm->BaseFromFrame(FrameOf(*arm, "root"), q), root_from_b.inverse());
  EXPECT_EQ(arm->JointsOf(FrameOf(*arm, "tip")), std::vector<size_t>{2});
  EXPECT_EQ(arm->JointsOf(FrameOf(*arm, "root")), (std::vector<size_t>{0, 1}));
}

// Against differences of the forward kinematics by hand.
TEST(ArmKinematics, JacobianIsTheMotionOfThePoint) {
  const auto arm = Arm(kThreeJointArm);
  const size_t thumb = FrameOf(*arm, "thumb");
  const Vec3 p_in_thumb(0.03, -0.02, 0.08);  // m
  const std::vector<double> q = {0.7, 0.3, -1.1};
  const auto jacobian = arm->Jacobian(thumb, 1e3 * (ThumbByHand(q) * p_in_thumb), q);
  ASSERT_EQ(jacobian.cols(), 3);
  for (size_t joint = 0; joint < 3; ++joint) {
    const double step = 1e-5;
    auto more = q, less = q;
    more[joint] += step;
    less[joint] -= step;
    const Vec3 moved = 1e3 * (ThumbByHand(more) * p_in_thumb - ThumbByHand(less) * p_in_thumb) / (2 * step);
    const Mat3 rate = (ThumbByHand(more).linear() - ThumbByHand(less).linear()) / (2 * step) *
                      ThumbByHand(q).linear().transpose();
    const auto column = jacobian.col(static_cast<Eigen::Index>(joint));
    EXPECT_NEAR((column.head<3>() - moved).norm(), 0, 1e-5);
    EXPECT_NEAR((column.tail<3>() - Vec3(rate(2, 1), rate(0, 2), rate(1, 0))).norm(), 0, 1e-8);
  }
}

TEST(ArmKinematics, JointsAreThoseThatMoveByThemselves) {
  const auto two = Arm(kTwoJointArm), three = Arm(kThreeJointArm);
  ASSERT_EQ(two->joints().size(), 2u);
  EXPECT_EQ(two->joints()[0].name, "shoulder");
  EXPECT_EQ(two->joints()[0].limits->upper, 2);
  EXPECT_EQ(two->joints()[1].kind, JointKind::kContinuous);
  EXPECT_FALSE(two->joints()[1].limits.has_value());
  EXPECT_EQ(two->JointsOf(FrameOf(*two, "upper")), std::vector<size_t>{0});
  EXPECT_TRUE(two->JointsOf(FrameOf(*two, "world")).empty());
  ASSERT_EQ(three->joints().size(), 3u);
  EXPECT_EQ(three->FindJoint("lift"), 1u);
  EXPECT_EQ(three->joints()[1].kind, JointKind::kPrismatic);
  EXPECT_FALSE(three->joints()[2].limits.has_value()) << "only effort and velocity are given";
  EXPECT_FALSE(three->FindJoint("grip").has_value());
  EXPECT_TRUE(three->IsDependent("grip"));
  EXPECT_TRUE(two->IsDependent("flange"));
  EXPECT_FALSE(two->IsDependent("elbow"));
}

TEST(ArmKinematics, VisualsAreThoseOfTheFrames) {
  const auto arm = Arm(R"(<robot name="drawn">
  <material name="blue"><color rgba="0 0.5 1 1"/></material>
  <link name="root">
    <visual>
      <origin xyz="0 0 0.1" rpy="0 1.5707963267948966 0"/> <geometry><cylinder radius="0.02" length="0.3"/></geometry>
      <material name="blue"/>
    </visual>
    <visual><geometry><mesh filename="package://none/arm.stl"/></geometry></visual>
    <visual><geometry><box size="0 0.1 0.1"/></geometry></visual>
  </link>
  <link name="hand">
    <visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual>
    <visual><geometry><sphere radius="0.04"/></geometry></visual>
  </link>
  <joint name="wrist" type="fixed"><parent link="root"/> <child link="hand"/></joint>
</robot>)");
  const std::vector<ArmVisual>& visuals = arm->visuals();
  ASSERT_EQ(visuals.size(), 3u);
  EXPECT_EQ(arm->frame_name(visuals[0].frame), "root");
  EXPECT_EQ(visuals[0].shape, VisualShape::kCylinder);
  EXPECT_EQ(visuals[0].size_mm, Vec3(40, 40, 300));
  ExpectSame(visuals[0].frame_from_visual, Origin(0, 0, 0.1, 0, kPi / 2));
  ASSERT_TRUE(visuals[0].color);
  EXPECT_NEAR((*visuals[0].color - Vec3(0, 0.5, 1)).norm(), 0, 1e-6);
  EXPECT_EQ(arm->frame_name(visuals[1].frame), "hand");
  EXPECT_EQ(visuals[1].shape, VisualShape::kBox);
  EXPECT_EQ(visuals[1].size_mm, Vec3(100, 200, 300));
  EXPECT_FALSE(visuals[1].color);
  EXPECT_EQ(visuals[2].shape, VisualShape::kSphere);
  EXPECT_EQ(visuals[2].size_mm, Vec3(80, 80, 80));
}

TEST(ArmKinematics, AMissingFrameListsThoseThereAre) {
  const auto frame = Arm(kTwoJointArm)->FindFrame("hand");
  ASSERT_FALSE(frame.ok());
  EXPECT_EQ(frame.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(frame.error().message, "arm.urdf: no link 'hand'; there are: world, upper, lower, wrist");
  const auto based = ArmKinematics::Parse("arm.urdf", kTwoJointArm, "floor");
  ASSERT_FALSE(based.ok());
  EXPECT_THAT(based.error().message, HasSubstr("no link 'floor'; there are: world"));
}

std::string Complaint(std::string urdf, const std::string& from = "", const std::string& to = "") {
  const auto at = urdf.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  const auto arm = ArmKinematics::Parse("arm.urdf", urdf.replace(at, from.size(), to));
  return arm.ok() ? "accepted" : arm.error().message;
}

TEST(ArmKinematics, BadFilesAreRefusedWithTheReason) {
  EXPECT_THAT(Complaint(""), HasSubstr("arm.urdf: no valid URDF"));
  EXPECT_THAT(Complaint("<robot name='a'>"), HasSubstr("arm.urdf: no valid URDF"));
  EXPECT_THAT(Complaint("<robot name='a'><xacro:property name='b'/></robot>"), HasSubstr("expand it first"));
  EXPECT_THAT(Complaint(kTwoJointArm, "xyz=\"0 0 2\"", "xyz=\"0 0 0\""),
              HasSubstr("joint 'elbow' has no direction"));
  EXPECT_THAT(Complaint(kTwoJointArm, "type=\"fixed\"", "type=\"floating\""),
              HasSubstr("joint 'flange' is neither revolute"));
  EXPECT_THAT(Complaint(kTwoJointArm, "0.3 0 0", "0.3 x 0"), HasSubstr("no valid URDF"));
  EXPECT_THAT(Complaint(kTwoJointArm, "0.3 0 0", "1e999 0 0"), HasSubstr("no valid URDF"));
  EXPECT_THAT(Complaint(kTwoJointArm, "<child link=\"wrist\"/>", "<child link=\"nowhere\"/>"),
              HasSubstr("no valid URDF"));
  EXPECT_THAT(Complaint(kThreeJointArm, "mimic joint=\"lift\"", "mimic joint=\"lost\""),
              HasSubstr("mimics 'lost', which is no joint"));
  EXPECT_THAT(Complaint(kThreeJointArm, "mimic joint=\"lift\"", "mimic joint=\"grip_too\""),
              HasSubstr("in a circle"));
  // Two links that lead only to each other.
  EXPECT_THAT(Complaint(kTwoJointArm, "<parent link=\"lower\"/>", "<parent link=\"wrist\"/>"),
              HasSubstr("no valid URDF"));
  EXPECT_EQ(ArmKinematics::Load("no-such.urdf").error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(ArmKinematics::Load("/").ok());
}

// `content` as a part of a robot that is good otherwise.
std::string WithContent(const std::string& content, const std::string& attributes = "") {
  return "<robot name='a'" + attributes + "><link name='b'/>" + content + "</robot>";
}

std::string Repeated(const std::string& text, size_t times) {
  std::string out;
  for (size_t i = 0; i < times; ++i) out += text;
  return out;
}

TEST(ArmKinematics, OnlyElementsAndAttributesAreXacro) {
  const std::string declared = " xmlns:xacro='http://www.ros.org/wiki/xacro'";
  for (const char* harmless :
       {"", "<!-- was: <xacro:property name='c'/> -->", "<!--> <xacro:if/> -->",
        "<c>  xacro:text <![CDATA[<xacro:if>]]></c>", "<c d=' xacro:value &lt;xacro:if>'/>"}) {
    EXPECT_EQ(Complaint(WithContent(harmless, declared)), "accepted") << harmless;
  }
  for (const char* command : {"<xacro:property name='c'/>", "<!-- --><xacro:if value='1'></xacro:if>",
                              "<link name='c' xacro:d='1'/>", "<c d='>'\n\txacro:e=''/>"}) {
    EXPECT_THAT(Complaint(WithContent(command, declared)), HasSubstr("expand it first")) << command;
  }
}

// The parser would recurse as deep.
TEST(ArmKinematics, DepthIsLimitedBeforeTheParser) {
  const auto nested = [](size_t depth) { return Repeated("<c>", depth) + Repeated("</c>", depth); };
  EXPECT_EQ(Complaint(WithContent(nested(99))), "accepted") << "with the robot 100";
  EXPECT_EQ(Complaint(WithContent(Repeated("<c></c><d/>", 200))), "accepted") << "one beside the other";
  EXPECT_THAT(Complaint(WithContent(nested(100))),
              HasSubstr("it has 101 levels of nested elements; at most 100"));
  EXPECT_THAT(Complaint(WithContent(nested(40'000))), HasSubstr("it has 40001 levels"));
  EXPECT_THAT(Complaint(Repeated("<c>", 40'000)), HasSubstr("it has 40000 levels"));
  EXPECT_THAT(Complaint(Repeated("</d>", 1000) + "<? ?>" + Repeated("<c d='>'>", 40'000)),
              HasSubstr("it has 40000 levels"))
      << "ends without beginnings count for nothing";
  EXPECT_THAT(Complaint("<?c " + Repeated("<c>", 40'000) + "?>"), HasSubstr("it has 40000 levels"))
      << "the parser takes this for elements";
}

TEST(ArmKinematics, SizeIsLimitedBeforeTheParser) {
  EXPECT_THAT(Complaint(WithContent(std::string(size_t{16} << 20, ' '))), HasSubstr("at most 16777216"));
  EXPECT_THAT(Complaint(WithContent(Repeated("<c/>", 100'000))),
              HasSubstr("it has 100002 elements; at most 100000"));
  // A chain of links is freed link by link, each within the one before it.
  std::string chain;
  for (int i = 0; i < 40'000; ++i) {
    const std::string name = std::to_string(i), next = std::to_string(i + 1);
    chain += "<link name='" + name + "'/>";
    if (i < 39'999)
      chain += "<joint name='" + name + "' type='fixed'><parent link='" + name + "'/><child link='" + next +
               "'/></joint>";
  }
  EXPECT_THAT(Complaint("<robot name='a'>" + chain + "</robot>"), HasSubstr("; at most"));
  EXPECT_THAT(Complaint(WithContent(Repeated("<link name='c'/>", 1000))),
              HasSubstr("it has 1001 links; at most 1000"));
}

}  // namespace
}  // namespace taclink::server

// What `taclink joints` reads and `taclink contacts` prints.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/command/cli/json.h"
#include "client/command/live/contacts_view.h"
#include "client/command/live/joint_lines.h"
#include "tests/integration/messages.h"

namespace taclink::command {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

JointLine LineOf(JointLineReader& reader, const std::string& text) {
  const auto read = reader.Read(text);
  EXPECT_TRUE(read.ok()) << read.error().message;
  return read.ok() && *read ? **read : JointLine{};
}

std::string Complaint(const std::vector<std::string>& lines) {
  JointLineReader reader;
  for (const auto& line : lines) {
    const auto read = reader.Read(line);
    if (!read) return read.error().message;
  }
  return "accepted";
}

TEST(JointLines, Csv) {
  JointLineReader reader;
  EXPECT_FALSE(reader.Read("# a comment")->has_value());
  EXPECT_FALSE(reader.Read("elbow, time_s ,lift\r")->has_value());
  const auto line = LineOf(reader, "0.5, 1.25, -2e-1\r");
  EXPECT_THAT(line.names, ElementsAre("elbow", "lift"));
  EXPECT_THAT(line.positions, ElementsAre(0.5, -0.2));
  EXPECT_EQ(line.time_s, 1.25);
  EXPECT_FALSE(reader.Read("")->has_value());
}

TEST(JointLines, AByteOrderMarkIsSkipped) {
  JointLineReader reader;
  EXPECT_FALSE(reader.Read("\xef\xbb\xbftime_s,elbow")->has_value());
  EXPECT_EQ(LineOf(reader, "1,2").time_s, 1);
}

TEST(JointLines, Json) {
  JointLineReader reader;
  auto line = LineOf(reader, R"({"positions": {"elbow": 0.5, "lift": 1}, "time_s": 2})");
  EXPECT_THAT(line.names, ElementsAre("elbow", "lift"));
  EXPECT_THAT(line.positions, ElementsAre(0.5, 1));
  EXPECT_EQ(line.time_s, 2);
  line = LineOf(reader, R"({"names": ["a"], "positions": [3], "velocities": [4]})");
  EXPECT_THAT(line.names, ElementsAre("a"));
  EXPECT_THAT(line.velocities, ElementsAre(4));
  EXPECT_FALSE(line.time_s.has_value());
}

TEST(JointLines, MistakesAreNamedWithTheirLine) {
  EXPECT_THAT(Complaint({"1,2"}), HasSubstr("line 1: '1' names no column; begin with"));
  for (const char* line : {"[1, 2]", "\"elbow\"", "a,,b", "a,{"})
    EXPECT_THAT(Complaint({line}), HasSubstr("names no column")) << line;
  EXPECT_THAT(Complaint({"a,b,a"}), HasSubstr("two columns are named 'a'"));
  EXPECT_THAT(Complaint({"a,\xff"}), HasSubstr("line 1: not UTF-8"));
  EXPECT_THAT(Complaint({"a,\x1b[2J"}), HasSubstr("control characters"));
  EXPECT_THAT(Complaint({"a,b", std::string("1,2\0,3", 6)}), HasSubstr("line 2: not UTF-8"));
  EXPECT_THAT(Complaint({std::string("{\"positions\": {\"a\": 1}}\0x", 26)}), HasSubstr("line 1: not UTF-8"));
  EXPECT_THAT(Complaint({"a,time_s", "1,1e300"}), HasSubstr("line 2: time_s must be"));
  EXPECT_THAT(Complaint({R"({"positions": {"a": 1}, "time_s": -1e10})"}), HasSubstr("time_s must be"));
  EXPECT_THAT(Complaint({"a", std::string(kLongestJointLine + 1, '1')}),
              HasSubstr("longer than 1,048,576 bytes"));
  EXPECT_THAT(Complaint({"a", "#" + std::string(kLongestJointLine, ' ')}), HasSubstr("longer than"));
  EXPECT_LT(Complaint({"a", std::string(100'000, 'x')}).size(), 200u);
  EXPECT_THAT(Complaint({"a,b", "1"}), HasSubstr("line 2: 1 cells for 2 columns"));
  EXPECT_THAT(Complaint({"a,b", "1,x"}), HasSubstr("'x' in column 'b' is not a number"));
  EXPECT_THAT(Complaint({"a", "nan"}), HasSubstr("not a number"));
  EXPECT_THAT(Complaint({"{\"a\": 1}"}), HasSubstr("\"positions\""));
  EXPECT_THAT(Complaint({"{"}), HasSubstr("no JSON object"));
  EXPECT_THAT(Complaint({R"({"positions": ["x"]})"}), HasSubstr("must be"));
  const auto nested = [](size_t depth) {
    return R"({"positions": {"a": 1}, "b": )" + std::string(depth, '[') + std::string(depth, ']') + "}";
  };
  JointLineReader reader;
  EXPECT_TRUE(reader.Read(nested(99)).ok());
  EXPECT_THAT(Complaint({nested(100)}), HasSubstr("a depth of 101; at most 100"));
  EXPECT_THAT(Complaint({nested(500'000)}), HasSubstr("a depth of 500001; at most 100"));
}

v1::StreamContactsResponse MakeArm() {
  v1::StreamContactsResponse arm;
  v1::ArmContact& contact = *arm.add_contacts();
  contact.set_id((uint64_t{1} << 40) + 3);
  contact.set_link("forearm");
  Set({0.1, 0.2, 0.3}, *contact.mutable_center_m());
  Set({-1, 0, 0.5}, *contact.mutable_wrench()->mutable_force_n());
  for (const double number : {0.0625, 0., 0., 0.25, 0., 4.}) contact.add_force_covariance_n2(number);
  contact.set_normal_force_n(1);
  contact.set_validity(v1::POSE_VALIDITY_STALE);
  for (const char* joint : {"elbow", "lift"}) arm.add_joint_names(joint);
  for (const double torque : {-0.25, 2.}) arm.add_joint_torques(torque);
  for (const double sigma : {0.125, 0.5}) arm.add_joint_torque_sigmas(sigma);
  arm.set_validity(v1::POSE_VALIDITY_STALE);
  return arm;
}

TEST(ContactsView, JsonHasEverything) {
  const Json json = Json::parse(ContactsJson(MakeArm()));
  const Json& contact = json.at("contacts")[0];
  EXPECT_EQ(contact.at("id"), 1099511627779);
  EXPECT_EQ(contact.at("center_mm")[1], 200);
  EXPECT_EQ(contact.at("force_sigma_n")[1], 0.5);
  EXPECT_TRUE(contact.at("center_sigma_mm").is_null());
  EXPECT_EQ(contact.at("pose"), "stale");
  EXPECT_EQ(json.at("joints").at("elbow").at("torque_nm"), -0.25);
  EXPECT_EQ(json.at("joints").at("lift").at("sigma_nm"), 0.5);
  auto unknown = MakeArm();
  unknown.clear_joint_torque_sigmas();
  const Json joints = Json::parse(ContactsJson(unknown)).at("joints");
  EXPECT_TRUE(joints.at("elbow").at("sigma_nm").is_null());
}

TEST(ContactsView, TableNamesContactsAndTorques) {
  const std::string table = ContactsTable(MakeArm());
  EXPECT_THAT(table, HasSubstr("forearm"));
  EXPECT_THAT(table, HasSubstr("stale"));
  EXPECT_THAT(table, HasSubstr("elbow -0.250 ±0.125  lift 2.000 ±0.500"));
  EXPECT_THAT(ContactsTable({}), HasSubstr("no contacts"));
}

}  // namespace
}  // namespace taclink::command

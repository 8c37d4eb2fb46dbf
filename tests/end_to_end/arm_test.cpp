// The sample arm: server, a player of joint positions and a reader of contacts, as a user runs them.
#include <gmock/gmock.h>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;

class SampleArm : public ScratchFolder {
 protected:
  void StartServer(const std::string& config) {
    server_ = std::make_unique<Process>(
        std::vector<std::string>{kTaclinkd, "--config", config, "--listen", "127.0.0.1:0"});
    address_ = AddressOf(*server_);
    ASSERT_NE(address_, "");
  }

  std::unique_ptr<Process> server_;
  std::string address_;
};

TEST_F(SampleArm, ContactsMoveWithTheJoints) {
  StartServer(ShippedConfig("arm.yaml"));
  Process player({kTaclink, "joints", "--server", address_, "--loop", ShippedConfig("arm-joints.csv")});
  Process contacts({kTaclink, "contacts", "--server", address_, "--json"});
  double nearest_x = 1e9, farthest_x = -1e9;
  bool loaded = false;
  for (int i = 0; i < 3000 && !(loaded && farthest_x - nearest_x > 50); ++i) {
    const auto line = contacts.ReadLine(seconds(60));
    ASSERT_TRUE(line.has_value());
    const json arm = json::parse(*line);
    for (const json& contact : arm.at("contacts")) {
      if (contact.at("link") != "forearm" || contact.at("pose") != "interpolated") continue;
      nearest_x = std::min(nearest_x, contact.at("center_mm")[0].get<double>());
      farthest_x = std::max(farthest_x, contact.at("center_mm")[0].get<double>());
      loaded = loaded || std::abs(arm.at("joints").at("shoulder_lift").at("torque_nm").get<double>()) > 1e-3;
    }
  }
  EXPECT_TRUE(loaded);
  EXPECT_GT(farthest_x - nearest_x, 50) << "mm; the arm swings the forearm forward";
}

TEST_F(SampleArm, MistakesSayWhatToDo) {
  const auto complaint = [&](const std::string& pose, const std::string& more) {
    const std::string config =
        Write("bad.yaml", "taclink_config: 1\narm:\n  name: a\n" + more +
                              "  links:\n    - {name: b, model: cylinder, source: simulated, "
                              "scene: press, pose: {position_mm: [0, 0, 0]" +
                              pose + "}}\n");
    const Finished run = RunToEnd({kTaclinkd, "--config", config, "--listen", "127.0.0.1:0"});
    EXPECT_EQ(run.exit_code, 1);
    return run.err;
  };
  EXPECT_THAT(complaint(", frame: hand", ""), HasSubstr("must have a 'urdf'"));
  const std::string urdf = "  urdf: " + ShippedConfig("arm.urdf") + "\n";
  EXPECT_THAT(complaint(", frame: elbow_link", urdf),
              HasSubstr("no link 'elbow_link'; there are: base_link, shoulder, upper_arm"));
  EXPECT_THAT(complaint("", urdf + "  base: floor\n"), HasSubstr("no link 'floor'"));
  EXPECT_THAT(complaint("", "  urdf: none.urdf\n"), HasSubstr("none.urdf cannot be read"));
}

TEST_F(SampleArm, JointsThatAreNotThereAreNamed) {
  StartServer(ShippedConfig("arm.yaml"));
  const Finished joints = Taclink({"joints", "--server", address_, Write("bad.csv", "knee\n0.1\n0.2\n")});
  EXPECT_EQ(joints.exit_code, 1);
  EXPECT_THAT(joints.err, HasSubstr("no joint 'knee'; there are: waist, shoulder_lift, elbow"));
  const Finished good = Taclink({"joints", "--server", address_, Write("good.csv", "elbow\n0.1\n0.2\n")});
  EXPECT_EQ(good.exit_code, 0) << good.err;
  EXPECT_THAT(good.out, HasSubstr("2 joint states accepted"));
}

}  // namespace
}  // namespace taclink::testing

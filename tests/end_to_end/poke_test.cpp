// A simulated link that users press, by the command.
#include <gmock/gmock.h>
#include <signal.h>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kFreeScene =
    "taclink_scene: 1\nname: rest\nmodel: cylinder\nframe_rate_hz: 20\nduration_s: 3600\n";
constexpr const char* kFreeArm = R"(taclink_config: 1
limits: {max_frame_age_s: 3600}
arm:
  name: test
  links:
    - {name: a, model: cylinder, source: simulated, scene: rest.yaml}
)";

class PokeTest : public ScratchFolder {
 protected:
  PokeTest() {
    Write("rest.yaml", kFreeScene);
    server_ = std::make_unique<Process>(std::vector<std::string>{
        kTaclinkd, "--config", Write("arm.yaml", kFreeArm), "--listen", "127.0.0.1:0"});
    address_ = AddressOf(*server_);
  }
  Finished Poke(std::vector<std::string> more) {
    std::vector<std::string> arguments = {"poke", "--link", "a", "--json", "--server", address_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Taclink(arguments);
  }
  json NewestFrame() {
    const Finished one = Taclink({"watch", "--json", "--links", "a", "--count", "3", "--server", address_});
    EXPECT_EQ(one.exit_code, 0) << one.err;
    return Lines(one.out).back();
  }
  // Until it holds of the newest frame.
  template <typename Holds>
  void WaitUntil(Holds holds) {
    for (int i = 0; i < 60; ++i)
      if (holds(NewestFrame())) return;
    FAIL() << "it does not come about";
  }

  std::unique_ptr<Process> server_;
  std::string address_;
};

TEST_F(PokeTest, WhatIsFeltIsWhatIsTrue) {
  WaitUntilMeasuring(address_, "a");
  ASSERT_EQ(Poke({"--pressure", "0.5"}).exit_code, 0);
  WaitUntil([](const json& frame) { return frame.at("pressure_kpa").get<double>() > 0.499; });
  const Finished poked = Poke({"--angle", "40", "--z", "85", "--force", "0.4", "--hold", "8"});
  ASSERT_EQ(poked.exit_code, 0) << poked.err;
  const json last = Lines(poked.out).back();
  EXPECT_EQ(last.at("status"), "ok") << poked.out;
  EXPECT_NEAR(last.at("true_n").get<double>(), 0.4, 0.01);
  EXPECT_NEAR(last.at("felt_n").get<double>(), last.at("true_n").get<double>(), 0.04);
  EXPECT_LT(last.at("off_mm").get<double>(), 4);
  EXPECT_EQ(last.at("trouble"), "");
  // Released with the command's end.
  WaitUntil([](const json& frame) { return frame.at("contacts").empty(); });
}

TEST_F(PokeTest, WhatStaysIsReleased) {
  WaitUntilMeasuring(address_, "a");
  ASSERT_EQ(Poke({"--z", "85", "--depth", "6", "--hold", "1", "--stay"}).exit_code, 0);
  WaitUntil([](const json& frame) { return !frame.at("contacts").empty(); });
  ASSERT_EQ(Poke({"--release"}).exit_code, 0);
  WaitUntil([](const json& frame) { return frame.at("contacts").empty(); });
}

TEST_F(PokeTest, WhatIsNotPossibleIsRefused) {
  const auto refused = [&](const std::vector<std::string>& arguments) {
    const Finished run = Poke(arguments);
    EXPECT_NE(run.exit_code, 0) << run.out;
    return run.err;
  };
  EXPECT_THAT(refused({}), HasSubstr("--depth or --force"));
  EXPECT_THAT(refused({"--force", "1"}), HasSubstr("--z"));
  EXPECT_THAT(refused({"--force", "1", "--depth", "1", "--z", "80"}), HasSubstr("--depth"));
  EXPECT_THAT(refused({"--force", "1", "--z", "800"}), HasSubstr("between the clamped ends"));
  EXPECT_THAT(refused({"--force", "100", "--z", "80"}), HasSubstr("20 N"));
  EXPECT_THAT(refused({"--joint", "10"}), HasSubstr("no joint"));
  EXPECT_THAT(refused({"--pressure", "5"}), HasSubstr("3 kPa"));
}

}  // namespace
}  // namespace taclink::testing

// A simulated link that is accepted, by the command.
#include <gmock/gmock.h>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kAcceptScene =
    "taclink_scene: 1\nname: rest\nmodel: cylinder\nframe_rate_hz: 20\nduration_s: 3600\n";

class AcceptTest : public ScratchFolder {
 protected:
  AcceptTest() {
    Write("rest.yaml", kAcceptScene);
    Write("plan.yaml",
          "taclink_acceptance: 1\nname: small\nseries:\n"
          "  - {name: loads, force_n: 0.5, pressure_kpa: 0.5, markers: [3, 4, 9, 7, 17, 5, 21, 8]}\n"
          "  - {name: hold, force_n: 0.4, pressure_kpa: 0.5, markers: [12, 6], hold_s: 10}\n");
    Start();
  }
  void Start() {
    server_ = std::make_unique<Process>(std::vector<std::string>{
        kTaclinkd, "--config",
        Write("arm.yaml", "taclink_config: 1\nlimits: {max_frame_age_s: 3600}\nacceptance: {folder: " +
                              Path("acceptance") +
                              "}\narm:\n  name: test\n  links:\n    - {name: a, model: cylinder, source: "
                              "simulated, scene: rest.yaml}\n"),
        "--listen", "127.0.0.1:0"});
    address_ = AddressOf(*server_);
    WaitUntilMeasuring(address_, "a");
  }
  Finished Accept(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"accept", "a", "--server", address_, "--plan", Path("plan.yaml")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Taclink(arguments);
  }
  // As a person at a terminal answers.
  Finished Answered(const std::string& lines, const std::string& more = "") {
    return RunToEnd({"/bin/sh", "-c",
                     "printf '" + lines + "' | " + kTaclink + " accept a --server " + address_ + " --plan " +
                         Path("plan.yaml") + " " + more});
  }
  json ListedAcceptance() {
    const Finished list = Taclink({"list", "--json", "--server", address_});
    EXPECT_EQ(list.exit_code, 0) << list.err;
    return json::parse(list.out).at("links").at(0).at("acceptance");
  }

  std::unique_ptr<Process> server_;
  std::string address_;
};

TEST_F(AcceptTest, SimulatedLinkIsAcceptedAndTheServerKnowsItAfterwards) {
  EXPECT_TRUE(ListedAcceptance().is_null());
  const Finished played = Accept({"--play", "--report", Path("report.html"), "--csv", Path("trials.csv")});
  EXPECT_THAT(played.out, HasSubstr("5 trials measured, 0 skipped, 0 open")) << played.err;
  const json acceptance = ListedAcceptance();
  ASSERT_TRUE(acceptance.is_object()) << played.out;
  EXPECT_EQ(acceptance.at("loads"), 5);
  EXPECT_LT(std::abs(acceptance.at("force_bias").get<double>()), 0.06) << played.out;
  EXPECT_LT(acceptance.at("place_error_95_mm").get<double>(), 4) << played.out;
  EXPECT_EQ(acceptance.at("outdated"), "");
  std::ifstream report(Path("report.html")), trials(Path("trials.csv"));
  const std::string page((std::istreambuf_iterator<char>(report)), {});
  EXPECT_THAT(page, HasSubstr("Acceptance of link a"));
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(trials), {}, '\n'), 6);
}

TEST_F(AcceptTest, InterruptedByAKilledServerItIsResumed) {
  // The body stays where the first trial wants it; the person says so, stops, and the server is killed.
  const Finished first = Answered("\\n\\n\\n\\nq\\n", "--weight 51");
  EXPECT_NE(first.exit_code, 0);
  EXPECT_THAT(first.err, HasSubstr("the same command resumes")) << first.out;
  server_->Signal(SIGKILL);
  server_->Wait(std::chrono::seconds(60));
  Start();
  const Finished second = Answered("s\\ns\\ns\\ns\\n");
  EXPECT_THAT(second.out, HasSubstr("Resuming: 1 of 5 trials are measured")) << second.err;
  EXPECT_THAT(second.out, HasSubstr("1 trials measured, 4 skipped, 0 open"));
  // Nothing was felt under the weight that was not there.
  EXPECT_THAT(second.out, HasSubstr("failed"));
  EXPECT_EQ(ListedAcceptance().at("verdict"), "failed");
}

// What the manometer shows belongs to its condition alone, and to trials that nothing touches as well.
TEST_F(AcceptTest, AManometersNumbersAreThoseOfTheirConditions) {
  Write("plan.yaml",
        "taclink_acceptance: 1\nname: pressures\nseries:\n"
        "  - {name: none, pressure_kpa: 0}\n  - {name: half, pressure_kpa: 0.5}\n");
  // One of the two conditions with a number, the other without one.
  const Finished run = Answered("0.6\\n\\n\\n\\n", "--csv " + Path("trials.csv"));
  ASSERT_THAT(run.out, HasSubstr("2 trials measured, 0 skipped, 0 open")) << run.err;
  std::ifstream file(Path("trials.csv"));
  const std::string trials((std::istreambuf_iterator<char>(file)), {});
  const size_t first = trials.find(",0.6,");
  ASSERT_NE(first, std::string::npos) << trials;
  EXPECT_EQ(trials.find(",0.6,", first + 1), std::string::npos) << trials;
}

TEST_F(AcceptTest, TheTrialBeforeIsRepeated) {
  const Finished first = Answered("\\n\\n\\n\\nr\\nq\\n", "--weight 51");
  EXPECT_THAT(first.out, HasSubstr("the trial before is done again")) << first.err;
  const Finished second = Answered("s\\ns\\ns\\ns\\ns\\n");
  EXPECT_THAT(second.err, HasSubstr("nothing was measured")) << second.out;
}

TEST_F(AcceptTest, MistakesAreSaid) {
  EXPECT_THAT(Taclink({"accept", "b", "--server", address_, "--play"}).err, HasSubstr("no link 'b'"));
  EXPECT_THAT(Taclink({"accept", "a", "--server", address_, "--plan", "no.yaml"}).err, HasSubstr("quick"));
  EXPECT_THAT(Accept({"--show"}).err, HasSubstr("has no acceptance"));
  EXPECT_THAT(Accept({"--finish"}).err, HasSubstr("start one"));
  EXPECT_EQ(Accept({"--play", "--weight", "0"}).exit_code, 2);
}

}  // namespace
}  // namespace taclink::testing

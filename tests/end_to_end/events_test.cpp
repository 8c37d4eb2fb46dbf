// Tare, thresholds and events by the commands, against a simulated link that is touched for a while.
#include <gmock/gmock.h>
#include <signal.h>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;

constexpr const char* kScene = R"(taclink_scene: 1
name: steady
model: cylinder
frame_rate_hz: 20
duration_s: 120
contacts:
  - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 6, end_s: 118, ramp_s: 0.2}
)";
constexpr const char* kRest =
    "taclink_scene: 1\nname: steady\nmodel: cylinder\nframe_rate_hz: 20\nduration_s: 600\n";
// No frame is called late on a busy machine: its events would be missing.
constexpr const char* kArm = R"(taclink_config: 1
limits: {max_frame_age_s: 3600}
events: {audit: audit.jsonl}
arm:
  name: test
  links:
    - name: a
      model: cylinder
      source: simulated
      scene: steady.yaml
      thresholds: {warning_n: 0.1, alarm_n: 0, hysteresis_n: 0.03}
      regions:
        - {name: near, rings: [4, 6], paths: [5, 9], warning_n: 0.1}
        - {name: far, rings: [4, 6], paths: [14, 16], warning_n: 0.1}
)";

class EventCommandTest : public ScratchFolder {
 protected:
  void Start(const char* scene) {
    Write("steady.yaml", scene);
    server_ = std::make_unique<Process>(
        std::vector<std::string>{kTaclinkd, "--config", Write("arm.yaml", kArm), "--listen", "127.0.0.1:0"});
    address_ = AddressOf(*server_);
    ASSERT_NE(address_, "");
    events_ = std::make_unique<Process>(
        std::vector<std::string>{kTaclink, "events", "--server", address_, "--json", "--all"});
  }
  // The next event of that kind.
  json Next(const std::string& kind) {
    for (int i = 0; i < 1000; ++i) {
      const auto line = events_->ReadLine(seconds(60));
      if (!line) break;
      json event = json::parse(*line);
      if (event.value("kind", "") == kind) return event;
    }
    ADD_FAILURE() << "no " << kind;
    return json::object();
  }
  Finished Tare(std::vector<std::string> more) {
    std::vector<std::string> arguments = {"tare", "a", "--json", "--server", address_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Taclink(arguments);
  }

  std::unique_ptr<Process> server_, events_;
  std::string address_;
};

TEST_F(EventCommandTest, FromTheTouchToTheTareThatIsForced) {
  Start(kScene);
  ASSERT_EQ(Next("baseline").value("link", ""), "a");
  const json begin = Next("contact_begin");
  EXPECT_GT(begin.at("latency_ms").get<double>(), 0);
  EXPECT_EQ(begin.at("link"), "a");
  json level = Next("force_level");
  if (level.value("region", "") == "") level = Next("force_level");
  EXPECT_EQ(level.value("region", ""), "near") << "never far";

  const Finished refused = Tare({});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.out, HasSubstr("touched: a contact of"));
  EXPECT_EQ(Next("tare").at("accepted"), false);

  const Finished forced = Tare({"--force", "--frames", "5"});
  ASSERT_EQ(forced.exit_code, 0) << forced.err;
  const json link = json::parse(forced.out).at("links")[0];
  EXPECT_TRUE(link.at("forced").get<bool>());
  EXPECT_GT(link.at("shift_mm").get<double>(), 0.3);
  EXPECT_EQ(Next("contact_end").at("contact_id"), begin.at("contact_id"));

  const Finished set =
      Taclink({"thresholds", "--link", "a", "--alarm", "0.4", "--json", "--server", address_});
  ASSERT_EQ(set.exit_code, 0) << set.err;
  const json thresholds = json::parse(set.out).at("thresholds");
  ASSERT_EQ(thresholds.size(), 3u);
  EXPECT_EQ(thresholds[0].at("alarm_n"), 0.4);
  EXPECT_EQ(thresholds[0].at("warning_n"), 0.1) << "what is not given stays";
  EXPECT_NE(Taclink({"thresholds", "--link", "a", "--alarm", "0.05", "--server", address_}).exit_code, 0);

  server_->Signal(SIGTERM);
  EXPECT_EQ(server_->Wait(seconds(60)).exit_code, 0);
  std::ifstream file(Path("audit.jsonl"));
  std::vector<std::string> what;
  for (std::string line; std::getline(file, line);) what.push_back(json::parse(line).at("what"));
  EXPECT_EQ(what, (std::vector<std::string>{"baseline", "tare", "tare", "thresholds", "thresholds"}));
}

TEST_F(EventCommandTest, AFreeLinkIsTared) {
  Start(kRest);
  Next("baseline");
  const Finished tare = Tare({});
  ASSERT_EQ(tare.exit_code, 0) << tare.out << tare.err;
  const json link = json::parse(tare.out).at("links")[0];
  EXPECT_FALSE(link.at("forced").get<bool>());
  EXPECT_LT(link.at("shift_mm").get<double>(), 0.2);
  const auto set = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"set", "--link", "a", "--server", address_});
    return Taclink(arguments);
  };
  const Finished both = set({"--force-model", "linear", "--camera", "top", "--exposure", "6"});
  EXPECT_EQ(both.exit_code, 0) << both.err;
  EXPECT_THAT(both.out, ::testing::AllOf(HasSubstr("top camera is set"), HasSubstr("linear model")));
  EXPECT_THAT(set({"--gain", "900"}).err, HasSubstr("gain must be 1 to 16"));
  EXPECT_THAT(set({"--camera", "top"}).err, HasSubstr("--camera also needs"));
  EXPECT_EQ(set({}).exit_code, 2);
  const Finished unknown = Taclink({"tare", "elbow", "--server", address_});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("no link 'elbow'"));
}

}  // namespace
}  // namespace taclink::testing

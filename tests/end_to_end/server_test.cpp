// taclinkd and taclink together, as processes, against the truth of the scenes they play.
#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <regex>

#include "sensing/camera/calibration_file.h"
#include "sensing/model/model_file.h"
#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;

// 20 frames a second with a steady touch after 2 s of rest. It comes back, so that a machine so busy that it
// missed the rest finds it later.
constexpr const char* kServedScene = R"(taclink_scene: 1
name: steady
model: cylinder
frame_rate_hz: 20
duration_s: 20
contacts:
  - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 2, end_s: 19, ramp_s: 0.2}
)";

class ServerTest : public ScratchFolder {
 protected:
  void StartServer(const std::string& config) {
    server_ = std::make_unique<Process>(std::vector<std::string>{
        kTaclinkd, "--config", Write("arm.yaml", config), "--listen", "127.0.0.1:0"});
    address_ = AddressOf(*server_);
    ASSERT_NE(address_, "");
  }

  void StartSteadyArm(const std::string& of_links = "",
                      const std::string& sections = "limits: {max_frame_age_s: 3600}\n") {
    Write("steady.yaml", kServedScene);
    const std::string settings = "model: cylinder, source: simulated, scene: steady.yaml" + of_links;
    StartServer("taclink_config: 1\n" + sections + "arm:\n  name: test\n  links:\n    - {name: a, " +
                settings + "}\n    - {name: b, " + settings + "}\n");
  }

  std::vector<std::string> Watch(std::vector<std::string> more) const {
    std::vector<std::string> command = {kTaclink, "watch",      "--server", address_,
                                        "--json", "--patience", "60"};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }

  // The first frame with `contacts` contacts.
  static json FrameWithContacts(Process& watch, size_t contacts) {
    for (int i = 0; i < 2000; ++i) {
      const auto line = watch.ReadLine(seconds(60));
      if (!line) break;
      json frame = json::parse(*line);
      if (frame.contains("contacts") && frame.at("contacts").size() == contacts) return frame;
    }
    const Finished ended = watch.Wait(seconds(0));
    ADD_FAILURE() << "no frame with " << contacts << " contacts; exit code " << ended.exit_code << ", "
                  << ended.err;
    return {};
  }

  std::unique_ptr<Process> server_;
  std::string address_;
};

TEST_F(ServerTest, ClientsGetTheForceThatTheSceneExerts) {
  StartSteadyArm();
  Process watch(Watch({"--links", "b"}));
  // The ramp takes 0.2 s; the frames after it have the full force.
  json frame = FrameWithContacts(watch, 1);
  const auto size = [&] { return ToVec3(frame.at("contacts")[0].at("force_n")).norm(); };
  for (int i = 0; i < 1000 && !frame.empty() && size() < 0.15; ++i) frame = FrameWithContacts(watch, 1);
  ASSERT_FALSE(frame.empty());
  EXPECT_EQ(frame.at("link"), "b");
  EXPECT_EQ(frame.at("status"), "ok");
  EXPECT_GE(frame.at("markers").at("seen").get<int>(), 220);
  const json& contact = frame.at("contacts")[0];
  const Vec3 force = ToVec3(contact.at("force_n")), center = ToVec3(contact.at("center_mm"));
  EXPECT_LT((force - Vec3(0, -0.2, 0)).norm(), 0.05);
  EXPECT_LT((center - Vec3(0, 32.3, 90)).norm(), 8);
  EXPECT_GT(frame.at("latency_ms").get<double>(), 0);
}

TEST_F(ServerTest, ListShowsEveryLink) {
  StartSteadyArm();
  // Of both: each link begins to measure at its own time.
  for (const char* link : {"a", "b"}) {
    Process watch(Watch({"--links", link}));
    FrameWithContacts(watch, 1);
  }
  const Finished list = Taclink({"list", "--server", address_, "--json"});
  ASSERT_EQ(list.exit_code, 0) << list.err;
  const json links = json::parse(list.out).at("links");
  ASSERT_EQ(links.size(), 2u);
  for (size_t i = 0; i < links.size(); ++i) {
    EXPECT_EQ(links[i].at("link"), i == 0 ? "a" : "b");
    EXPECT_EQ(links[i].at("state"), "ok");
    EXPECT_GT(links[i].at("frames").get<int>(), 0);  // their rate depends on the machine
    EXPECT_TRUE(links[i].at("rate_hz").is_number());
    EXPECT_GT(links[i].at("latency_p50_ms").get<double>(), 0);
  }
  EXPECT_THAT(Taclink({"list", "--server", address_}).out, HasSubstr("CONTACTS"));
}

TEST_F(ServerTest, ShutsDownOnSigtermAndSaysWhy) {
  StartSteadyArm();
  Process watch(Watch({}));
  ASSERT_TRUE(watch.ReadLine(seconds(60)).has_value());
  server_->Signal(SIGTERM);
  const Finished server = server_->Wait(seconds(60));
  EXPECT_EQ(server.exit_code, 0) << server.err;
  const Finished client = watch.Wait(seconds(60));
  EXPECT_EQ(client.exit_code, 1);
  EXPECT_THAT(client.err, HasSubstr("shutting down"));
}

TEST_F(ServerTest, KilledServerIsNoticed) {
  StartSteadyArm();
  Process watch(Watch({}));
  ASSERT_TRUE(watch.ReadLine(seconds(60)).has_value());
  server_->Signal(SIGKILL);
  const Finished client = watch.Wait(seconds(60));
  EXPECT_EQ(client.exit_code, 1);
  EXPECT_FALSE(client.err.empty());
}

TEST_F(ServerTest, PicturesOfAFolderAreServed) {
  const Finished simulated = Taclink({"simulate", "--scene", Write("steady.yaml", kServedScene), "--out",
                                      Path("pictures"), "--frames", "80"});
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  StartServer(
      "taclink_config: 1\nlimits: {max_frame_age_s: 3600}\narm:\n  name: test\n  links:\n"
      // So slowly that a busy machine solves enough of the first two seconds' pictures for a rest shape.
      "    - {name: taped, model: cylinder, source: files, folder: pictures, frame_rate_hz: 5}\n");
  Process watch(Watch({}));
  const json frame = FrameWithContacts(watch, 1);
  EXPECT_EQ(frame.at("link"), "taped");
}

TEST_F(ServerTest, CalibrationIsSavedAndUsedFromTheNextStartOn) {
  Write("rest.yaml", "taclink_scene: 1\nname: rest\nmodel: cylinder\nframe_rate_hz: 20\nduration_s: 600\n");
  const std::string config =
      "taclink_config: 1\nlimits: {max_frame_age_s: 3600}\narm:\n  name: test\n  links:\n"
      "    - {name: a, model: cylinder, source: simulated, scene: rest.yaml, calibration: a_cameras.yaml}\n";
  StartServer(config);  // the file does not exist yet
  WaitUntilMeasuring(address_, "a");
  const Finished saved =
      Taclink({"calibrate", "--link", "a", "--pairs", "3", "--repeat", "3", "--save", "--server", address_});
  ASSERT_EQ(saved.exit_code, 0) << saved.err;
  EXPECT_THAT(saved.out, HasSubstr("a_cameras.yaml"));
  EXPECT_THAT(saved.out, HasSubstr("over 3 calibrations"));
  EXPECT_THAT(saved.out, HasSubstr("The top camera has moved by 0.0"));
  const auto rig = LoadCalibration(Path("a_cameras.yaml"), LoadLinkModel("cylinder").value());
  ASSERT_TRUE(rig.ok()) << rig.error().message;

  StartServer(config);
  Process watch(Watch({}));
  EXPECT_TRUE(watch.ReadLine(seconds(60)).has_value());
  WaitUntilMeasuring(address_, "a");
  EXPECT_THAT(Taclink({"list", "--server", address_}).out, HasSubstr("a: cameras calibrated 2"));
  Write("b.yaml", std::regex_replace(config, std::regex("name: a,"), "name: b,"));
  const Finished other = RunToEnd({kTaclinkd, "--config", Path("b.yaml"), "--listen", "127.0.0.1:0"});
  EXPECT_NE(other.exit_code, 0);
  EXPECT_THAT(other.err, HasSubstr("'link' is 'a', but this is the calibration file of link 'b'"));
  Write("a_cameras.yaml", "taclink_calibration: nonsense\n");
  const Finished refused = RunToEnd({kTaclinkd, "--config", Path("arm.yaml"), "--listen", "127.0.0.1:0"});
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.err, HasSubstr("a_cameras.yaml:1"));
}

TEST_F(ServerTest, MissingCameraIsAStatusAndNoOtherLinkMinds) {
  Write("steady.yaml", kServedScene);
  StartServer(
      "taclink_config: 1\nlimits: {max_frame_age_s: 3600}\narm:\n  name: test\n  links:\n"
      "    - {name: blind, model: cylinder, source: v4l2, devices: [/dev/taclink-none-0, "
      "/dev/taclink-none-1]}\n"
      "    - {name: well, model: cylinder, source: simulated, scene: steady.yaml}\n");
  Process watch(Watch({}));
  bool blind = false, well = false;
  for (int i = 0; i < 500 && !(blind && well); ++i) {
    const auto line = watch.ReadLine(seconds(60));
    ASSERT_TRUE(line.has_value());
    const json frame = json::parse(*line);
    if (!frame.contains("link")) continue;
    if (frame.at("link") == "well") well = well || frame.at("status") == "ok";
    if (frame.at("link") == "blind" && frame.at("status") != "starting") {
      blind = true;
      EXPECT_EQ(frame.at("status"), "lost");
      EXPECT_THAT(frame.at("reason").get<std::string>(), HasSubstr("/dev/taclink-none-0"));
    }
  }
  EXPECT_TRUE(blind);
  EXPECT_TRUE(well);
}

// A client that stops reading costs the server nothing and no other client anything; its gap is counted.
TEST_F(ServerTest, StoppedClientHarmsNobody) {
  // Without the nonlinear skin, which takes its memory when a dent first asks for it, and with a queue that
  // keeps 2 MB of frames: what waits for a client without a bound would be 35 MB and more at the end. The
  // stopped client is not given up, however long the frames take.
  StartSteadyArm(", force_model: linear",
                 "limits: {queue_messages: 32, keepalive_s: 3600, max_frame_age_s: 3600}\n");
  Process slow(Watch({"--detail", "full", "--every"}));
  ASSERT_TRUE(slow.ReadLine(seconds(60)).has_value());
  Process other(Watch({}));
  FrameWithContacts(other, 1);
  slow.Signal(SIGSTOP);
  // Frames are the clock here: 2 links x 20 a second x 30 s, far more than the pipes and the queue hold.
  uint64_t last = 0;
  long before_kb = 0;
  for (int i = 0; i < 1200; ++i) {
    const auto line = other.ReadLine(seconds(60));
    ASSERT_TRUE(line.has_value());
    const json frame = json::parse(*line);
    if (!frame.contains("link") || frame.at("link") != "a") continue;
    if (frame.at("exposure_utc_ns").get<int64_t>() == 0) continue;  // a heartbeat repeats the last number
    const auto sequence = frame.at("sequence").get<uint64_t>();
    EXPECT_GT(sequence, last);
    last = sequence;
    if (i < 200) before_kb = server_->ResidentKb();
  }
  EXPECT_LT(server_->ResidentKb(), before_kb + 20000);
  slow.Signal(SIGCONT);
  const auto gap = slow.ReadUntil("\"dropped\"", seconds(60));
  ASSERT_TRUE(gap.has_value());
  EXPECT_GT(json::parse(*gap).at("dropped").at("a").get<int>(), 100) << *gap;
}

TEST_F(ServerTest, TheBenchMeasuresAServerOfItsOwn) {
  const std::string program = std::string(kTaclink) + "-bench";  // beside it
  const Finished bench = RunToEnd({program, "server", "--links", "2", "--clients", "3", "--detail",
                                   "geometry", "--seconds", "1", "--json", Path("bench.json")});
  ASSERT_EQ(bench.exit_code, 0) << bench.err;
  const json row = json::parse(std::ifstream(Path("bench.json"))).at(0);
  EXPECT_EQ(row.at("links"), 2);
  EXPECT_EQ(row.at("clients"), 3);
  EXPECT_EQ(row.at("detail"), "geometry");
  EXPECT_GT(row.at("received").get<int>(), 0);
  EXPECT_GE(row.at("exposure_to_client_ms").at("p99"), row.at("exposure_to_client_ms").at("p50"));
  EXPECT_GE(row.at("exposure_to_client_ms").at("p50"), row.at("memory_to_client_ms").at("p50"));
  EXPECT_GT(row.at("memory_to_client_ms").at("p50").get<double>(), 0);
  EXPECT_GT(row.at("server_cores").get<double>(), 0);
  EXPECT_GT(row.at("server_mb").get<double>(), 0);
  const Finished refused = RunToEnd({program, "server", "--links", "1", "--taclinkd", "/no/such/program"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("/no/such/program"));
}

TEST_F(ServerTest, BadConfigurationIsRefusedWithFileAndLine) {
  const auto refused = [&](const std::string& config, const std::string& hint) {
    const Finished run = RunToEnd({kTaclinkd, "--config", Write("bad.yaml", config)});
    EXPECT_EQ(run.exit_code, 1) << config;
    EXPECT_THAT(run.err, HasSubstr(hint));
  };
  refused(
      "taclink_config: 1\narm:\n  name: x\n  links:\n    - {name: a, model: cylinder, source: telepathy}\n",
      "bad.yaml:5");
  refused(
      "taclink_config: 1\narm:\n  name: x\n  links:\n    - {name: a, model: cylinder, source: simulated, "
      "scen: press}\n",
      "bad.yaml:5: 'arm.links[0].scen' is not a known key");
  refused(
      "taclink_config: 1\narm:\n  name: x\n  links:\n    - {name: a, model: cube, source: simulated, scene: "
      "press}\n",
      "cube");
  EXPECT_EQ(RunToEnd({kTaclinkd, "--no-such-option"}).exit_code, 2);
  const Finished open = RunToEnd({kTaclinkd, "--listen", "0.0.0.0:0"});
  EXPECT_EQ(open.exit_code, 1);
  EXPECT_THAT(open.err, HasSubstr("--insecure-open"));
}

}  // namespace
}  // namespace taclink::testing

#include "server/config/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

constexpr const char* kGood = R"(taclink_config: 1
server: {listen: "[::1]:6000"}
limits: {max_streams: 3, max_streams_per_peer: 2, max_message_kb: 128, queue_mb: 32, queue_mb_per_peer: 48, keepalive_s: 7}
http: {listen: "[::1]:80", web_root: ../web, max_connections: 7, max_connections_per_peer: 5, idle_timeout_s: 2.5}
security: {certificate: s.pem, key: s.key, client_ca: /c.pem, tokens: tokens, tokens_on_error: keep, tokens_permissions: any, max_failed_tries_per_minute: 3}
events: {history: 50, update_rate_hz: 2, audit: audit.jsonl}
arm:
  name: left
  links:
    - name: upper
      model: models/special.yaml
      source: v4l2
      devices: [/dev/v4l/by-path/a, /dev/v4l/by-path/b]
      width_px: 1280
      height_px: 720
      frame_rate_hz: 60
      format: mjpeg
      exposure_100us: 50
      gain: 0
      calibration: ../calibration.yaml
      pressure_kpa: 1.5
      drift: {time_constant_s: 600, rate_limit_mm_s: 0.0001, quiet_s: 20}
      pose: {position_mm: [1, 2, 3], rotation_deg: [0, 0, 90]}
    - name: lower
      model: barrel
      force_model: nonlinear
      force_refinement: 2
      source: files
      folder: pictures
      loop: false
      in_memory: true
      yuyv: true
      start_after_s: 0.25
      drift: {follow: false}
    - name: wrist
      model: cylinder
      source: v4l2
      devices: ["usb:1-2.3", "serial:A1"]
    - name: third
      model: cylinder
      force_model: auto
      source: simulated
      scene: press
      thresholds: {warning_n: 0.5, alarm_n: 1.5, hysteresis_n: 0.1}
      regions:
        - {name: palm, rings: [1, 5], paths: [18, 2], warning_n: 0.2}
)";

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string Complaint(const std::string& text);

TEST(Config, ThePaceOfASceneIsReadAndPrinted) {
  const auto text = [](const std::string& pace) {
    return "taclink_config: 1\narm:\n  name: x\n  links:\n"
           "    - {name: a, model: cylinder, source: simulated, scene: press" +
           pace + "}\n";
  };
  for (const auto& [written, pace] :
       {std::pair("", ScenePace::kFrames), std::pair(", pace: frames", ScenePace::kFrames),
        std::pair(", pace: clock", ScenePace::kClock)}) {
    const auto config = ParseConfig("arm.yaml", text(written), "/etc");
    ASSERT_TRUE(config.ok()) << config.error().message;
    EXPECT_EQ(std::get<SimulatedSourceConfig>(config->links[0].source).pace, pace) << written;
    const auto again = ParseConfig("printed", ConfigText(*config), "/etc");
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(std::get<SimulatedSourceConfig>(again->links[0].source).pace, pace) << written;
  }
  EXPECT_THAT(Complaint(text(", pace: fast")), HasSubstr("frames, clock"));
}

std::string Complaint(const std::string& text) {
  const auto config = ParseConfig("arm.yaml", text, "");
  return config.ok() ? "accepted" : config.error().message;
}

TEST(Config, ReadsEverything) {
  const auto config = ParseConfig("arm.yaml", kGood, "/etc/taclink");
  ASSERT_TRUE(config.ok()) << config.error().message;
  EXPECT_EQ(config->listen, "[::1]:6000");
  EXPECT_EQ(config->limits.max_streams, 3);
  EXPECT_EQ(config->limits.queue_messages, 256);
  EXPECT_EQ(config->limits.max_streams_per_peer, 2);
  EXPECT_EQ(config->limits.max_message_kb, 128);
  EXPECT_EQ(config->limits.queue_mb, 32);
  EXPECT_EQ(config->limits.queue_mb_per_peer, 48);
  EXPECT_EQ(config->limits.keepalive_s, 7);
  EXPECT_EQ(config->http.listen, "[::1]:80");
  EXPECT_EQ(config->http.web_root, "/etc/web");
  EXPECT_EQ(config->http.max_connections, 7);
  EXPECT_EQ(config->http.max_connections_per_peer, 5);
  EXPECT_EQ(config->http.idle_timeout_s, 2.5);
  EXPECT_EQ(config->security.certificate, "/etc/taclink/s.pem");
  EXPECT_EQ(config->security.client_ca, "/c.pem");
  EXPECT_EQ(config->security.tokens, "/etc/taclink/tokens");
  EXPECT_TRUE(config->security.tokens_keep);
  EXPECT_TRUE(config->security.tokens_open);
  EXPECT_EQ(config->security.max_failed_tries, 3);
  ASSERT_EQ(config->links.size(), 4u);
  const LinkConfig& upper = config->links[0];
  EXPECT_EQ(upper.model, "/etc/taclink/models/special.yaml");
  EXPECT_EQ(upper.calibration, "/etc/calibration.yaml");
  EXPECT_EQ(std::get<ConstantPressureConfig>(upper.pressure->source).kpa, 1.5);
  EXPECT_FALSE(config->links[1].pressure.has_value());
  ASSERT_TRUE(upper.drift.has_value());
  EXPECT_EQ(upper.drift->time_constant_s, 600);
  EXPECT_EQ(upper.drift->rate_limit_mm_s, 0.0001);
  EXPECT_EQ(upper.drift->quiet_s, 20);
  EXPECT_FALSE(config->links[1].drift.has_value());
  EXPECT_EQ(config->events.history, 50);
  EXPECT_EQ(config->events.update_rate_hz, 2);
  EXPECT_EQ(config->events.audit, "/etc/taclink/audit.jsonl");
  EXPECT_EQ(config->links[0].rules.thresholds.warning_n, 0);
  const LinkRules& rules = config->links[3].rules;
  EXPECT_EQ(rules.thresholds.alarm_n, 1.5);
  ASSERT_EQ(rules.regions.size(), 1u);
  EXPECT_EQ(rules.regions[0].first_ring, 0);
  EXPECT_EQ(rules.regions[0].last_ring, 4);
  EXPECT_EQ(rules.regions[0].first_path, 17);
  EXPECT_EQ(rules.regions[0].last_path, 1);
  EXPECT_EQ(rules.regions[0].thresholds.warning_n, 0.2);
  EXPECT_TRUE(config->links[2].drift.has_value()) << "on if nothing is said";
  const auto& v4l2 = std::get<V4l2SourceConfig>(upper.source);
  EXPECT_EQ(v4l2.devices[1], "/dev/v4l/by-path/b");
  EXPECT_EQ(v4l2.format, PixelFormat::kMjpeg);
  EXPECT_EQ(v4l2.exposure_100us, 50);
  EXPECT_EQ(v4l2.gain, 0);
  const auto& wrist = std::get<V4l2SourceConfig>(config->links[2].source);
  EXPECT_EQ(wrist.devices[0], "usb:1-2.3");
  EXPECT_FALSE(wrist.format.has_value()) << "auto";
  const auto& files = std::get<FileSourceConfig>(config->links[1].source);
  EXPECT_EQ(files.folder, "/etc/taclink/pictures");
  EXPECT_FALSE(files.loop);
  EXPECT_TRUE(files.in_memory);
  EXPECT_TRUE(files.yuyv);
  EXPECT_EQ(files.start_after_s, 0.25);
  EXPECT_EQ(config->links[1].model, "barrel");
  EXPECT_EQ(config->links[1].force_model, ForceModel::kNonlinear);
  EXPECT_EQ(config->links[1].force_refinement, 2);
  EXPECT_EQ(config->links[3].force_refinement, 0);
  EXPECT_FALSE(config->links[3].force_model.has_value()) << "auto";
  EXPECT_EQ(std::get<SimulatedSourceConfig>(config->links[3].source).scene, "press");
  EXPECT_EQ(std::get<SimulatedSourceConfig>(config->links[3].source).pace, ScenePace::kFrames);
  const Vec3 p_in_base = upper.FrameFromLink() * Vec3(10, 0, 0);
  EXPECT_NEAR((p_in_base - Vec3(1, 12, 3)).norm(), 0, 1e-12);
}

TEST(Config, LinearUnderPressureIsRefusedUnlessItIsMeant) {
  const auto with = [](const std::string& more) {
    return Complaint(Replaced(kGood, "      pressure_kpa: 1.5\n", more + "      force_model: linear\n"));
  };
  for (const char* inflated : {"      pressure_kpa: 1.5\n", "      pressure: {source: grpc}\n"}) {
    EXPECT_THAT(with(inflated), ::testing::AllOf(HasSubstr("force_model"), HasSubstr("auto")));
    EXPECT_EQ(with(std::string(inflated) + "      force_model_anyway: true\n"), "accepted");
  }
  EXPECT_EQ(with("      pressure_kpa: 0\n"), "accepted");
  EXPECT_EQ(with(""), "accepted");
}

TEST(Config, WhatIsMeantIsPrinted) {
  const auto config = ParseConfig(
      "arm.yaml",
      Replaced(kGood, "      pressure_kpa: 1.5\n",
               "      pressure_kpa: 1.5\n      force_model: linear\n      force_model_anyway: true\n"),
      "");
  ASSERT_TRUE(config.ok());
  EXPECT_EQ(Complaint(ConfigText(*config)), "accepted");
}

constexpr const char* kJointed = R"(taclink_config: 1
arm:
  name: jointed
  urdf: arm.urdf
  base: "floor"
  joint_states: {stale_after_s: 0.5, extrapolate_s: 0.02}
  links:
    - {name: a, model: barrel, source: simulated, scene: press, pose: {frame: wrist, position_mm: [0, 0, 5]}}
    - {name: b, model: barrel, source: simulated, scene: press}
)";

TEST(Config, LinksSitOnFramesOfTheUrdf) {
  const auto config = ParseConfig("arm.yaml", kJointed, "/etc/taclink");
  ASSERT_TRUE(config.ok()) << config.error().message;
  EXPECT_EQ(config->kinematics.urdf, "/etc/taclink/arm.urdf");
  EXPECT_EQ(config->kinematics.base, "floor");
  EXPECT_EQ(config->kinematics.joint_states.stale_after, std::chrono::milliseconds(500));
  EXPECT_EQ(config->kinematics.joint_states.extrapolate, std::chrono::milliseconds(20));
  EXPECT_EQ(config->links[0].frame, "wrist");
  EXPECT_TRUE(config->links[1].frame.empty());
  EXPECT_THAT(Complaint(Replaced(kJointed, "  urdf: arm.urdf\n", "")),
              HasSubstr("'arm.base' is a link of a URDF"));
  EXPECT_THAT(Complaint(Replaced(kJointed, "  urdf: arm.urdf\n  base: \"floor\"\n", "")),
              HasSubstr("joint_states"));
  EXPECT_THAT(Complaint(Replaced(Replaced(kJointed, "  urdf: arm.urdf\n  base: \"floor\"\n", ""),
                                 "  joint_states: {stale_after_s: 0.5, extrapolate_s: 0.02}\n", "")),
              HasSubstr("must have a 'urdf'"));
  EXPECT_THAT(Complaint(Replaced(kJointed, "stale_after_s: 0.5", "stale_after_s: 0")),
              HasSubstr("stale_after_s"));
  EXPECT_THAT(Complaint(Replaced(kJointed, "extrapolate_s: 0.02", "extrapolate_s: 0.7")),
              HasSubstr("extrapolate_s"));
  EXPECT_THAT(Complaint(Replaced(kJointed, "urdf: arm.urdf", "urdf: ''")), HasSubstr("urdf"));
}

std::string Pressed(const std::string& pressure) {
  return "taclink_config: 1\narm:\n  name: a\n  links:\n    - {name: b, model: barrel, source: files, "
         "folder: c, "
         "pressure: " +
         pressure + "}\n";
}

TEST(Config, PressureComesFromManySources) {
  const auto read = [](const std::string& pressure) {
    const auto config = ParseConfig("arm.yaml", Pressed(pressure), "/etc/taclink");
    EXPECT_TRUE(config.ok()) << config.error().message;
    return config.ok() ? *config->links[0].pressure : PressureConfig{};
  };
  const auto serial =
      read("{source: serial, device: /dev/ttyUSB0, baud: 115200, kpa_per_unit: 0.1, stale_after_s: 2}");
  EXPECT_EQ(std::get<SerialPressureConfig>(serial.source).device, "/dev/ttyUSB0");
  EXPECT_EQ(std::get<SerialPressureConfig>(serial.source).baud, 115200);
  EXPECT_EQ(serial.kpa_per_unit, 0.1);
  EXPECT_EQ(serial.stale_after_s, 2);
  const auto file = read("{source: file, path: kpa.txt, offset_kpa: -101.3}");
  EXPECT_EQ(std::get<FilePressureConfig>(file.source).path, "/etc/taclink/kpa.txt");
  EXPECT_EQ(file.offset_kpa, -101.3);
  EXPECT_EQ(std::get<ConstantPressureConfig>(read("{source: constant, kpa: 3}").source).kpa, 3);
  EXPECT_TRUE(std::holds_alternative<ClientPressureConfig>(read("{source: grpc}").source));
  for (const char* pressure : {"{source: grpc, stale_after_s: 3}", "{source: file, path: a, kpa_per_unit: 2}",
                               "{source: serial, device: /dev/b}", "{source: constant, kpa: -1}"}) {
    const auto config = ParseConfig("arm.yaml", Pressed(pressure), "/etc");
    ASSERT_TRUE(config.ok()) << config.error().message;
    const auto again = ParseConfig("printed", ConfigText(*config), "/elsewhere");
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(ConfigText(*again), ConfigText(*config));
  }
  EXPECT_THAT(Complaint(Pressed("{source: simulated}")), HasSubstr("where the link's source is"));
  EXPECT_THAT(Complaint(Pressed("{source: sensor}")), HasSubstr("constant, simulated, file, serial, grpc"));
  EXPECT_THAT(Complaint(Pressed("{source: serial}")), HasSubstr("device' is missing"));
  EXPECT_THAT(Complaint(Pressed("{source: serial, device: a, baud: 12}")), HasSubstr("usual rate"));
  EXPECT_THAT(Complaint(Pressed("{source: constant}")), HasSubstr("kpa' is missing"));
  EXPECT_THAT(Complaint(Pressed("{source: constant, kpa: 1, baud: 9600}")),
              HasSubstr("baud' is not a known key"));
  EXPECT_THAT(Complaint(Pressed("{source: file, path: a, kpa_per_unit: 0}")), HasSubstr("must not be 0"));
  EXPECT_THAT(Complaint(Pressed("{source: grpc}, pressure_kpa: 1")), HasSubstr("give one of them"));
}

TEST(Config, PrintedReadsBackToTheSame) {
  for (const auto& config : {ParseConfig("arm.yaml", kGood, "/etc/taclink"),
                             ParseConfig("arm.yaml", kJointed, "/etc/taclink"), DemoConfig()}) {
    ASSERT_TRUE(config.ok()) << config.error().message;
    const std::string text = ConfigText(*config);
    const auto again = ParseConfig("printed", text, "/elsewhere");
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(ConfigText(*again), text);
  }
}

TEST(Config, DemoIsFourLinksOnLoopback) {
  const auto config = DemoConfig();
  ASSERT_TRUE(config.ok()) << config.error().message;
  EXPECT_EQ(config->links.size(), 4u);
  EXPECT_TRUE(IsLoopback(config->listen));
}

TEST(Config, MistakesAreNamedWithFileAndLine) {
  EXPECT_THAT(Complaint(Replaced(kGood, "max_streams:", "max_steams:")),
              HasSubstr("arm.yaml:3: 'limits.max_steams' is not a known key"));
  EXPECT_THAT(Complaint(Replaced(kGood, "queue_mb: 32", "queue_mb: 0")), HasSubstr("limits.queue_mb"));
  EXPECT_THAT(Complaint(Replaced(kGood, "taclink_config: 1", "taclink_config: 2")), HasSubstr("version"));
  EXPECT_THAT(Complaint(Replaced(kGood, "frame_rate_hz: 60", "frame_rate_hz: fast")),
              HasSubstr("arm.yaml:16: 'arm.links[0].frame_rate_hz' must be a number, not 'fast'"));
  EXPECT_THAT(Complaint(Replaced(kGood, "source: files", "source: film")),
              HasSubstr("v4l2, files, simulated"));
  EXPECT_THAT(Complaint(Replaced(kGood, "force_model: auto", "force_model: best")),
              HasSubstr("auto, literal, linear, pressurised, nonlinear"));
  EXPECT_THAT(Complaint(Replaced(kGood, "force_refinement: 2", "force_refinement: 9")),
              HasSubstr("force_refinement"));
  EXPECT_THAT(Complaint(Replaced(kGood, "quiet_s: 20", "go_n: 0.5")), HasSubstr("must be below stop_n"));
  EXPECT_THAT(Complaint(Replaced(kGood, "alarm_n: 1.5", "alarm_n: 0.1")),
              HasSubstr("alarm_n must not be below warning_n"));
  EXPECT_THAT(Complaint(Replaced(kGood, "paths: [18, 2]", "paths: [18]")), HasSubstr("2 whole numbers"));
  EXPECT_THAT(Complaint(Replaced(kGood, "format: mjpeg", "format: h264")),
              HasSubstr("auto, yuyv, mjpeg, grey"));
  EXPECT_THAT(Complaint(Replaced(kGood, "name: lower", "name: upper")), HasSubstr("used by another link"));
  EXPECT_THAT(Complaint(Replaced(kGood, "name: lower", "name: 'a b'")), HasSubstr("letters"));
  EXPECT_THAT(Complaint(Replaced(kGood, ", /dev/v4l/by-path/b", "")), HasSubstr("list of two cameras"));
  EXPECT_THAT(Complaint(Replaced(kGood, "/dev/v4l/by-path/b", "video1")), HasSubstr("usb:1-2.3 or serial:"));
  EXPECT_THAT(Complaint(Replaced(kGood, "scene: press", "scenes: press")),
              HasSubstr("scenes' is not a known key"));
  EXPECT_THAT(Complaint(Replaced(kGood, "      scene: press\n", "")), HasSubstr("scene' is missing"));
  EXPECT_THAT(Complaint(Replaced(kGood, "loop: false", "gain: 3")), HasSubstr("gain' is not a known key"));
  EXPECT_THAT(Complaint(Replaced(kGood, "[1, 2, 3]", "[1, 2]")), HasSubstr("3 numbers"));
  EXPECT_THAT(Complaint(Replaced(kGood, "[::1]:6000", "6000")), HasSubstr("host:port"));
  EXPECT_THAT(Complaint(Replaced(kGood, "key: s.key, ", "")),
              HasSubstr("'security.certificate' is of no use alone"));
  EXPECT_THAT(Complaint(Replaced(kGood, "certificate: s.pem, key: s.key, ", "")),
              HasSubstr("security.client_ca"));
  EXPECT_THAT(Complaint(Replaced(kGood, "\"[::1]:80\"", "unix:/a")), HasSubstr("not a unix socket"));
  EXPECT_THAT(Complaint(Replaced(kGood, "idle_timeout_s: 2.5", "idle_timeout_s: 0")),
              HasSubstr("idle_timeout_s"));
  EXPECT_THAT(Complaint(Replaced(kGood, "folder: pictures", "folder: \"pic\\ntures\"")),
              HasSubstr("on one line"));
  EXPECT_THAT(Complaint(Replaced(kGood, "name: lower", "\"na\\nme\": lower")), HasSubstr("[1].na me'"));
  EXPECT_THAT(Complaint("taclink_config: 1\narm: {name: a}\n"), HasSubstr("at least one link"));
  EXPECT_THAT(Complaint("taclink_config: 1\n"), HasSubstr("arm"));
  EXPECT_THAT(Complaint(""), HasSubstr("mapping"));
}

// The parser would take one of two, and the first document, without a word.
TEST(Config, KeysStandOnceAndTheFileIsOneDocument) {
  EXPECT_THAT(Complaint(Replaced(kGood, "source: files", "source: files\n      source: v4l2")),
              HasSubstr("'arm.links[1].source' stands here a second time"));
  EXPECT_THAT(Complaint(std::string(kGood) + "\narm: {name: other}\n"),
              HasSubstr("'arm' stands here a second"));
  EXPECT_THAT(Complaint(std::string(kGood) + "\n---\nlog: {level: debug}\n"),
              HasSubstr("holds more than one document"));
}

TEST(Config, LinksAreBounded) {
  std::string text = "taclink_config: 1\nlimits: {max_links: 3}\narm:\n  name: a\n  links:\n";
  for (int link = 1; link <= 3; ++link)
    text += "    - {name: l" + std::to_string(link) + ", model: barrel, source: simulated, scene: press}\n";
  EXPECT_TRUE(ParseConfig("arm.yaml", text, "").ok());
  text += "    - {name: l4, model: barrel, source: simulated, scene: press}\n";
  EXPECT_THAT(Complaint(text), HasSubstr("'arm.links' has 4, more than limits.max_links, which is 3"));
}

TEST(Config, AMissingFileSaysSo) {
  const auto config = LoadConfig("no-such-file.yaml");
  ASSERT_FALSE(config.ok());
  EXPECT_EQ(config.error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(LoadConfig("/").ok());
}

TEST(ListenAddress, Forms) {
  for (const char* good :
       {"127.0.0.1:0", "localhost:50051", "[::1]:1", "0.0.0.0:65535", "unix:/tmp/x", "robot:80"})
    EXPECT_TRUE(CheckListenAddress(good).ok()) << good;
  for (const char* bad :
       {"", "127.0.0.1", ":1", "127.0.0.1:", "127.0.0.1:65536", "a:-1", "a:1x", "::1:80", "unix:"})
    EXPECT_FALSE(CheckListenAddress(bad).ok()) << bad;
}

TEST(ListenAddress, OnlyThisMachineIsLoopback) {
  for (const char* here : {"127.0.0.1:0", "127.8.9.1:1", "localhost:1", "[::1]:1", "unix:/tmp/x"})
    EXPECT_TRUE(IsLoopback(here)) << here;
  for (const char* open : {"0.0.0.0:1", "[::]:1", "192.168.1.2:1", "127.evil.example:1", "localhost.evil:1",
                           "127.0.0.1.evil:1", "[::ffff:192.168.1.2]:1", "1270.0.0.1:1"})
    EXPECT_FALSE(IsLoopback(open)) << open;
}

}  // namespace
}  // namespace taclink::server

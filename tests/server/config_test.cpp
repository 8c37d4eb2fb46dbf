#include "server/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace taclink::server {
namespace {

using testing::HasSubstr;

constexpr const char* kGood = R"(taclink_config: 1
server: {listen: "[::1]:6000"}
limits: {max_streams: 3}
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
      pose: {position_mm: [1, 2, 3], rotation_deg: [0, 0, 90]}
    - name: lower
      model: barrel
      force_model: nonlinear
      force_refinement: 2
      source: files
      folder: pictures
      loop: false
    - {name: third, model: cylinder, force_model: auto, source: simulated, scene: press}
)";

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
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
  ASSERT_EQ(config->links.size(), 3u);
  const LinkConfig& upper = config->links[0];
  EXPECT_EQ(upper.model, "/etc/taclink/models/special.yaml");
  EXPECT_EQ(upper.calibration, "/etc/calibration.yaml");
  EXPECT_EQ(upper.pressure_kpa, 1.5);
  const auto& v4l2 = std::get<V4l2SourceConfig>(upper.source);
  EXPECT_EQ(v4l2.devices[1], "/dev/v4l/by-path/b");
  EXPECT_EQ(v4l2.format, PixelFormat::kMjpeg);
  EXPECT_EQ(v4l2.exposure_100us, 50);
  EXPECT_EQ(v4l2.gain, 0);
  const auto& files = std::get<FileSourceConfig>(config->links[1].source);
  EXPECT_EQ(files.folder, "/etc/taclink/pictures");
  EXPECT_FALSE(files.loop);
  EXPECT_EQ(config->links[1].model, "barrel");
  EXPECT_EQ(config->links[1].force_model, ForceModel::kNonlinear);
  EXPECT_EQ(config->links[1].force_refinement, 2);
  EXPECT_EQ(config->links[2].force_refinement, 0);
  EXPECT_FALSE(config->links[2].force_model.has_value()) << "auto";
  EXPECT_EQ(std::get<SimulatedSourceConfig>(config->links[2].source).scene, "press");
  const Vec3 p_in_base = upper.BaseFromLink() * Vec3(10, 0, 0);
  EXPECT_NEAR((p_in_base - Vec3(1, 12, 3)).norm(), 0, 1e-12);
}

TEST(Config, PrintedReadsBackToTheSame) {
  for (const auto& config : {ParseConfig("arm.yaml", kGood, "/etc/taclink"), DemoConfig()}) {
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
  EXPECT_THAT(Complaint(Replaced(kGood, "max_streams", "max_steams")),
              HasSubstr("arm.yaml:3: 'limits.max_steams' is not a known key"));
  EXPECT_THAT(Complaint(Replaced(kGood, "taclink_config: 1", "taclink_config: 2")), HasSubstr("version"));
  EXPECT_THAT(Complaint(Replaced(kGood, "frame_rate_hz: 60", "frame_rate_hz: fast")),
              HasSubstr("arm.yaml:13: 'arm.links[0].frame_rate_hz' must be a number, not 'fast'"));
  EXPECT_THAT(Complaint(Replaced(kGood, "source: files", "source: film")),
              HasSubstr("v4l2, files, simulated"));
  EXPECT_THAT(Complaint(Replaced(kGood, "force_model: auto", "force_model: best")),
              HasSubstr("auto, literal, linear, pressurised, nonlinear"));
  EXPECT_THAT(Complaint(Replaced(kGood, "force_refinement: 2", "force_refinement: 9")),
              HasSubstr("force_refinement"));
  EXPECT_THAT(Complaint(Replaced(kGood, "format: mjpeg", "format: h264")), HasSubstr("yuyv, mjpeg"));
  EXPECT_THAT(Complaint(Replaced(kGood, "name: lower", "name: upper")), HasSubstr("used by another link"));
  EXPECT_THAT(Complaint(Replaced(kGood, "name: lower", "name: 'a b'")), HasSubstr("letters"));
  EXPECT_THAT(Complaint(Replaced(kGood, ", /dev/v4l/by-path/b", "")), HasSubstr("two device paths"));
  EXPECT_THAT(Complaint(Replaced(kGood, "scene: press", "scenes: press")),
              HasSubstr("scenes' is not a known key"));
  EXPECT_THAT(Complaint(Replaced(kGood, ", scene: press", "")), HasSubstr("scene' is missing"));
  EXPECT_THAT(Complaint(Replaced(kGood, "loop: false", "gain: 3")), HasSubstr("gain' is not a known key"));
  EXPECT_THAT(Complaint(Replaced(kGood, "[1, 2, 3]", "[1, 2]")), HasSubstr("3 numbers"));
  EXPECT_THAT(Complaint(Replaced(kGood, "[::1]:6000", "6000")), HasSubstr("host:port"));
  EXPECT_THAT(Complaint("taclink_config: 1\narm: {name: a}\n"), HasSubstr("at least one link"));
  EXPECT_THAT(Complaint("taclink_config: 1\n"), HasSubstr("arm"));
  EXPECT_THAT(Complaint(""), HasSubstr("mapping"));
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

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "server/config/config.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

Result<Config> ParseRecording(const std::string& section) {
  return ParseConfig("arm.yaml",
                     "taclink_config: 1\n" + section +
                         "arm:\n  name: x\n  links:\n"
                         "    - {name: a, model: cylinder, source: simulated, scene: press}\n",
                     "/etc/taclink");
}

TEST(ConfigRecording, ReadsAndPrintsTheSame) {
  const auto config = ParseRecording(
      "recording: {folder: logs, at_start: true, pictures: true, compression: lz4, picture_compression: "
      "zstd, "
      "split_mb: 10, split_s: 0, quota_mb: 100, sync_s: 0.5, queue_mb: 64, scene_rate_hz: 0}\n");
  ASSERT_TRUE(config.ok()) << config.error().message;
  const RecordingConfig& recording = config->recording;
  EXPECT_EQ(recording.folder, "/etc/taclink/logs");
  EXPECT_TRUE(recording.at_start && recording.pictures);
  EXPECT_EQ(recording.compression, mcap::Compression::kLz4);
  EXPECT_EQ(recording.picture_compression, mcap::Compression::kZstd);
  EXPECT_EQ(recording.split_mb, 10);
  EXPECT_EQ(recording.split_s, 0);
  EXPECT_EQ(recording.quota_mb, 100);
  EXPECT_EQ(recording.sync_s, 0.5);
  const std::string text = ConfigText(*config);
  const auto again = ParseConfig("again.yaml", text, "");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(ConfigText(*again), text);
}

TEST(ConfigRecording, MistakesAreNamed) {
  for (const char* wrong : {"recording: {compression: zip}\n", "recording: {sync_s: 0}\n",
                            "recording: {quota: 5}\n", "recording: {folder: '', at_start: true}\n"}) {
    const auto config = ParseRecording(wrong);
    ASSERT_FALSE(config.ok()) << wrong;
    EXPECT_THAT(config.error().message, HasSubstr("arm.yaml:2")) << wrong;
  }
}

TEST(ConfigRecording, LogsAreInTheHomeFolderUnlessTold) {
  ASSERT_EQ(::setenv("XDG_STATE_HOME", "/state", 1), 0);
  EXPECT_EQ(ParseRecording("")->recording.folder, "/state/taclink/logs");
  ASSERT_EQ(::unsetenv("XDG_STATE_HOME"), 0);
  EXPECT_EQ(ParseRecording("recording: {folder: ''}\n")->recording.folder, "");
}

}  // namespace
}  // namespace taclink::server

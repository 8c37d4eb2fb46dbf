// The format's own library reads what the server records, and what the command makes of it.
#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>
#include <fstream>

#include "tests/end_to_end/support.h"
#include "tests/mcap/judge.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using mcap::MessageOrder;
using std::chrono::seconds;

class LogJudge : public ScratchFolder {
 protected:
  // Four seconds' frames of two links, pictures as well. Returns the log's path.
  std::string Record(const std::string& compression) const {
    Write("touch.yaml",
          "taclink_scene: 1\nname: touch\nmodel: cylinder\nframe_rate_hz: 10\nduration_s: 3\n"
          "contacts:\n  - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 1, end_s: 2, ramp_s: 0.2}\n");
    const std::string config =
        Write("arm.yaml",
              "taclink_config: 1\nserver: {listen: '127.0.0.1:0'}\nrecording: {folder: " + Path("logs") +
                  ", compression: " + compression + ", picture_compression: " + compression +
                  "}\nlimits: {max_frame_age_s: 3600}\narm:\n  name: test\n  links:\n"
                  "    - {name: a, model: cylinder, source: simulated, scene: touch.yaml}\n"
                  "    - {name: b, model: cylinder, source: simulated, scene: touch.yaml,\n"
                  "       pose: {position_mm: [0, 0, 200]}}\n");
    Process server({kTaclinkd, "--config", config});
    const std::string address = AddressOf(server);
    const std::string log = RecordFrames(address, {"a", "b"}, 80, {"--pictures"});
    server.Signal(SIGTERM);
    EXPECT_EQ(server.Wait(seconds(60)).exit_code, 0);
    return log.empty() ? "" : Path("logs/" + log);
  }
  void Make(const std::vector<std::string>& arguments) const {
    const Finished made = Taclink(arguments);
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
};

TEST_F(LogJudge, ReadsRecordedCutAndMergedLogsAlike) {
  for (const std::string compression : {"none", "lz4", "zstd"}) {
    const std::string log = Record(compression);
    ASSERT_FALSE(log.empty());
    const std::filesystem::path folder = Path(compression);
    std::filesystem::create_directory(folder);
    std::filesystem::rename(log, folder / "recorded.mcap");
    const std::string recorded = folder / "recorded.mcap";
    Make({"log", "cut", recorded, "-o", folder / "first.mcap", "--to", "2"});
    Make({"log", "cut", recorded, "-o", folder / "second.mcap", "--from", "2"});
    Make({"log", "merge", folder / "first.mcap", folder / "second.mcap", "-o", folder / "merged.mcap"});
    const json read = mcap::testing::RunJudge("read", folder);
    ASSERT_EQ(read.size(), 4U);
    for (const auto& [name, told] : read.items()) {
      std::ifstream file(folder / name, std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(file), {}};
      EXPECT_EQ(told["streamed"], mcap::testing::DigestOf(mcap::AsBytes(bytes), MessageOrder::kFile)) << name;
      EXPECT_EQ(told["indexed"], mcap::testing::DigestOf(mcap::AsBytes(bytes), MessageOrder::kLogTime))
          << name;
      EXPECT_GT(told["streamed"]["topics"].size(), 6U) << name;
      EXPECT_EQ(told["streamed"].count("error"), 0U) << name;
      EXPECT_EQ(Taclink({"log", "check", folder / name}).exit_code, 0) << name;
    }
  }
}

}  // namespace
}  // namespace taclink::testing

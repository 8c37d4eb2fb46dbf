// A recording, played by the server that made it and served by one that has nothing else.
#include <gmock/gmock.h>
#include <signal.h>

#include <set>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;

class ReplayTest : public ScratchFolder {
 protected:
  std::string Config() const {
    Write("rest.yaml", "taclink_scene: 1\nname: rest\nmodel: cylinder\nframe_rate_hz: 10\nduration_s: 600\n");
    return Write("arm.yaml",
                 "taclink_config: 1\nserver: {listen: '127.0.0.1:0'}\nrecording: {folder: " + Path("logs") +
                     "}\nlimits: {max_frame_age_s: 3600}\narm:\n  name: test\n  links:\n"
                     "    - {name: a, model: cylinder, source: simulated, scene: rest.yaml}\n"
                     "    - {name: b, model: cylinder, source: simulated, scene: rest.yaml,\n"
                     "       pose: {position_mm: [0, 0, 200]}}\n");
  }
};

TEST_F(ReplayTest, WhatWasRecordedIsPlayedAndServed) {
  std::string log;
  std::set<std::pair<std::string, int64_t>> exposures;  // of all frames of the log
  {
    Process server({kTaclinkd, "--config", Config()});
    const std::string address = AddressOf(server);
    log = RecordFrames(address, {"a", "b"}, 60);
    const Finished played = Taclink(
        {"record", "play", log, "--json", "--speed", "0", "--detail", "geometry", "--server", address});
    ASSERT_EQ(played.exit_code, 0) << played.err;
    for (const json& frame : Lines(played.out)) {
      EXPECT_TRUE(frame.at("replayed").get<bool>());
      EXPECT_TRUE(frame.at("latency_ms").is_null());
      if (frame.at("status") == "ok") {
        EXPECT_EQ(frame.at("positions_mm").size(), 240u);
      }
      exposures.emplace(frame.at("link"), frame.at("exposure_utc_ns").get<int64_t>());
    }
    EXPECT_GT(exposures.size(), 10u);
    const Finished one = Taclink({"record", "play", log, "--json", "--speed", "0", "--link", "b", "--from",
                                  "1", "--to", "2", "--server", address});
    ASSERT_EQ(one.exit_code, 0) << one.err;
    for (const json& frame : Lines(one.out)) EXPECT_EQ(frame.at("link"), "b");
    EXPECT_LT(Lines(one.out).size(), Lines(played.out).size() / 2);
    const Finished none = Taclink({"record", "play", "none.mcap", "--server", address});
    EXPECT_EQ(none.exit_code, 1);
    EXPECT_THAT(none.err, HasSubstr("none.mcap"));
    server.Signal(SIGTERM);
    EXPECT_EQ(server.Wait(seconds(60)).exit_code, 0);
  }

  Process server({kTaclinkd, "--replay", Path("logs/" + log), "--listen", "127.0.0.1:0"});
  const std::string address = AddressOf(server);
  const Finished watched =
      Taclink({"watch", "--json", "--every", "--count", "60", "--patience", "60", "--server", address});
  ASSERT_EQ(watched.exit_code, 0) << watched.err;
  int frames = 0;
  for (const json& frame : Lines(watched.out)) {
    if (frame.at("exposure_utc_ns") == 0) continue;  // before the first one
    ++frames;
    EXPECT_TRUE(frame.at("replayed").get<bool>());
    EXPECT_NE(frame.at("status"), "lost") << frame.at("reason");
    EXPECT_TRUE(exposures.contains({frame.at("link"), frame.at("exposure_utc_ns").get<int64_t>()}));
  }
  EXPECT_GT(frames, 20);
  const Finished contacts = Taclink({"contacts", "--json", "--count", "1", "--server", address});
  EXPECT_EQ(contacts.exit_code, 0) << contacts.err;
  const Finished tare = Taclink({"tare", "--server", address});
  EXPECT_NE(tare.exit_code, 0);
  EXPECT_THAT(tare.out + tare.err, HasSubstr("plays a log"));
  const Finished restart = Taclink({"restart", "--link", "a", "--server", address});
  EXPECT_EQ(restart.exit_code, 1);
  EXPECT_THAT(restart.err, HasSubstr("plays a log"));
  EXPECT_TRUE(server.ReadUntil("begins again", seconds(60), true).has_value());
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(seconds(60)).exit_code, 0);
}

TEST_F(ReplayTest, WhatCannotBeServedIsSaid) {
  for (const std::string& file : {Path("none.mcap"), Write("text.mcap", "this is no log"), FuzzLog("zstd")}) {
    const Finished run = RunToEnd({kTaclinkd, "--replay", file});
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.err, HasSubstr(file));
  }
}

}  // namespace
}  // namespace taclink::testing

// taclinkd as a service: systemd's socket, signals, and checks of its configuration.
#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"
#include "tests/support/service_manager.h"

namespace taclink::testing {
namespace {

using std::chrono::seconds;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

constexpr const char* kLinks =
    "arm:\n  name: test\n  links:\n"
    "    - {name: a, model: cylinder, source: simulated, scene: rest.yaml}\n";
constexpr const char* kRestScene =
    "taclink_scene: 1\nname: rest\nmodel: cylinder\nframe_rate_hz: 20\nduration_s: 600\n";

class OperationsTest : public ScratchFolder {
 protected:
  OperationsTest() { Write("rest.yaml", kRestScene); }
  std::string Config(const std::string& sections) const {
    return Write("arm.yaml", "taclink_config: 1\n" + sections + kLinks);
  }
};

TEST_F(OperationsTest, SystemdHearsOfItsLife) {
  const ServiceManager systemd{"@taclink-end-to-end-" + std::to_string(getpid())};
  Process server({"/usr/bin/env", "NOTIFY_SOCKET=" + systemd.name(), "WATCHDOG_USEC=2000000", kTaclinkd,
                  "--config", Config("server: {listen: '127.0.0.1:0'}\n")});
  EXPECT_THAT(systemd.Await("READY=1"), HasSubstr("STATUS=listening on 127.0.0.1:"));
  for (int i = 0; i < 3; ++i) systemd.Await("WATCHDOG=1");
  server.Signal(SIGHUP);
  EXPECT_THAT(systemd.Await("RELOADING=1"), HasSubstr("MONOTONIC_USEC="));
  EXPECT_EQ(systemd.Await("READY=1"), "READY=1");
  server.Signal(SIGTERM);
  systemd.Await("STOPPING=1");
  EXPECT_EQ(server.Wait(seconds(60)).exit_code, 0);
}

TEST_F(OperationsTest, SighupTakesOverWhatItCanAndNamesTheRest) {
  Process server({kTaclinkd, "--config", Config("server: {listen: '127.0.0.1:0'}\n")});
  ASSERT_TRUE(server.ReadUntil("listening on", seconds(60), true).has_value());
  Config("server: {listen: '127.0.0.1:1'}\nlimits: {max_streams: 2}\nlog: {format: json}\n");
  server.Signal(SIGHUP);
  const auto line = server.ReadUntil("SIGHUP", seconds(60), true);
  ASSERT_TRUE(line.has_value());
  const json told = json::parse(*line);
  EXPECT_EQ(told.at("message"),
            "SIGHUP: taken over: limits, log; needs a restart: server; changed keys: server.listen, "
            "limits.max_streams, log.format; access: nothing");
  EXPECT_EQ(told.at("level"), "info");
  Config("limits: {max_streams: none}\n");
  server.Signal(SIGHUP);
  const auto refused = server.ReadUntil("SIGHUP", seconds(60), true);
  ASSERT_TRUE(refused.has_value());
  EXPECT_THAT(*refused, HasSubstr("the configuration in use stays"));
  EXPECT_THAT(*refused, HasSubstr("arm.yaml:2"));
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(seconds(60)).exit_code, 0);
}

TEST_F(OperationsTest, CheckConfigFindsAllThatIsWrongAndStartsNothing) {
  const Finished good = RunToEnd({kTaclinkd, "--check-config", "--config", Config("")});
  EXPECT_EQ(good.exit_code, 0) << good.err;
  EXPECT_EQ(good.out, "OK\n");
  const Finished bad = RunToEnd(
      {kTaclinkd, "--check-config", "--config",
       Write("bad.yaml",
             "taclink_config: 1\nserver: {listen: '0.0.0.0:0'}\nsecurity: {tokens: no-such-tokens}\n"
             "publish: {url: 'nats://localhost', token_file: no-such-secret}\narm:\n  name: x\n  links:\n"
             "    - {name: a, model: cube, source: simulated, scene: rest.yaml}\n"
             "    - {name: b, model: cylinder, source: simulated, scene: nowhere.yaml}\n"
             "    - {name: c, model: cylinder, source: v4l2, devices: [/dev/video9990, /dev/video9991]}\n"
             "    - {name: d, model: cylinder, source: v4l2, devices: [/dev/video9990, /dev/video9992]}\n"
             "    - {name: e, model: cylinder, source: files, folder: no-such-pictures}\n"
             "    - {name: f, model: cylinder, source: files, folder: .}\n"
             "    - {name: g, model: cylinder, source: simulated, scene: inflate, force_model: linear}\n")});
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_THAT(bad.err, HasSubstr("no-such-tokens"));
  EXPECT_THAT(bad.err, HasSubstr("no-such-secret"));
  EXPECT_THAT(bad.err, HasSubstr("0.0.0.0"));
  EXPECT_THAT(bad.err, HasSubstr("link 'a': "));
  EXPECT_THAT(bad.err, HasSubstr("cube"));
  EXPECT_THAT(bad.err, HasSubstr("link 'b': "));
  EXPECT_THAT(bad.err, HasSubstr("nowhere.yaml"));
  EXPECT_THAT(bad.err, HasSubstr("/dev/video9990 is used by link 'c' already"));
  EXPECT_THAT(bad.err, HasSubstr("note: link 'c': /dev/video9991 may be another camera tomorrow"));
  EXPECT_THAT(bad.err, ContainsRegex("link 'e': .*no-such-pictures: .*; expected a folder with"));
  EXPECT_THAT(bad.err, ContainsRegex("link 'f': .*: has no pictures named top_000001"));
  EXPECT_THAT(bad.err, HasSubstr("link 'g': force_model is 'linear', which does not hold"));
  EXPECT_EQ(bad.out, "");
}

}  // namespace
}  // namespace taclink::testing

// What --check-config passes starts; what would not start it says.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;
using ::testing::HasSubstr;

constexpr seconds kStartOrEnd{120};
constexpr const char* kAnyPort = "server: {listen: '127.0.0.1:0'}\nhttp: {listen: ''}\n";
constexpr const char* kBareArm = "arm:\n  name: x\n  links:\n";
constexpr const char* kOneLink = "    - {name: a, model: cylinder, source: simulated, scene: rest.yaml}\n";
constexpr const char* kStillScene =
    "taclink_scene: 1\nname: rest\nmodel: cylinder\nframe_rate_hz: 5\nduration_s: 600\n";
// Each link's parent is the other.
constexpr const char* kCycle =
    "<robot name='r'><link name='base'/><link name='a'/><link name='b'/>"
    "<joint name='1' type='fixed'><parent link='a'/><child link='b'/></joint>"
    "<joint name='2' type='fixed'><parent link='b'/><child link='a'/></joint></robot>";

struct ConfigCase {
  const char* name;
  std::string config;
  const char* complaint = "";  ///< empty: it passes, and starts
};

/// A port that somebody else listens on.
class TakenPort {
 public:
  TakenPort() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(socket_, 1), 0);
    EXPECT_EQ(::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
  }
  ~TakenPort() { ::close(socket_); }
  TakenPort(const TakenPort&) = delete;
  TakenPort& operator=(const TakenPort&) = delete;
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

 private:
  const int socket_;
  int port_ = 0;
};

std::string ManyLinks(int count) {
  std::string out = kBareArm;
  for (int i = 0; i < count; ++i)
    out += "    - {name: l" + std::to_string(i) + ", model: cylinder, source: simulated, scene: rest.yaml}\n";
  return out;
}

class ConfigCheckTest : public ScratchFolder {
 protected:
  ConfigCheckTest() {
    Write("rest.yaml", kStillScene);
    Write("file", "");
    Write("cycle.urdf", kCycle);
  }
  std::string With(const std::string& sections,
                   const std::string& arm = std::string(kBareArm) + kOneLink) const {
    return "taclink_config: 1\n" + sections + arm;
  }
  static bool Starts(const std::string& config) {
    Process server({kTaclinkd, "--config", config});
    const bool starts = server.ReadUntil("listening on", kStartOrEnd, true).has_value();
    if (starts) server.Signal(SIGTERM);
    const int code = server.Wait(kStartOrEnd).exit_code;
    EXPECT_EQ(code, starts ? 0 : 1) << config;
    return starts;
  }
  std::vector<ConfigCase> Cases() const {
    const std::string taken = taken_.address(), free = TakenPort().address(), plain = kAnyPort;
    return {
        {"plain", With(plain)},
        {"all outputs",
         With(plain + "events: {audit: new/audit}\nrecording: {folder: new/logs, at_start: true}\n")},
        {"unix socket", With("server: {listen: 'unix:" + Path("socket") + "'}\nhttp: {listen: ''}\n")},
        {"socket's path", With("server: {listen: 'unix:/" + std::string(120, 'x') + "'}\n"),
         "shorter than 108"},
        {"socket's folder", With("server: {listen: 'unix:" + Path("no") + "/s'}\n"), "No such file"},
        {"no socket", With("server: {listen: 'unix:" + Path("file") + "'}\nhttp: {listen: ''}\n"),
         "a file that is no socket is there"},
        {"port in use", With("server: {listen: '" + taken + "'}\nhttp: {listen: ''}\n"), "it is in use"},
        {"HTTP port in use", With("server: {listen: '127.0.0.1:0'}\nhttp: {listen: '" + taken + "'}\n"),
         "http.listen: cannot listen on"},
        {"one address for both", With("server: {listen: '" + free + "'}\nhttp: {listen: '" + free + "'}\n"),
         "server.listen has that port already"},
        {"key twice", With(plain + "log: {level: info, level: debug}\n"),
         "'log.level' stands here a second time"},
        {"two documents", With(plain) + "---\nlog: {level: debug}\n", "holds more than one document"},
        {"URDF with a cycle",
         With(plain, "arm:\n  name: x\n  urdf: cycle.urdf\n  links:\n" + std::string(kOneLink)),
         "cycle.urdf"},
        {"too many links", With(plain, ManyLinks(1000)), "more than limits.max_links, which is 32"},
        {"log below a file", With(plain + "log: {file: '" + Path("file/log") + "'}\n"), "is no folder"},
        {"log is a folder", With(plain + "log: {file: '" + Path("") + "'}\n"), "is no regular file"},
        {"no page", With("server: {listen: '127.0.0.1:0'}\nhttp: {listen: '127.0.0.1:0', web_root: .}\n"),
         "no folder with an index.html"},
        {"no tokens", With(plain + "security: {tokens: no-such-tokens}\n"), "no-such-tokens"},
        {"name like an option", With(plain, "arm:\n  name: -rf\n  links:\n" + std::string(kOneLink)),
         "the first neither '-' nor '.'"},
    };
  }

 private:
  const TakenPort taken_;
};

TEST_F(ConfigCheckTest, WhatItPassesStartsAndTheRestDoesNot) {
  for (const ConfigCase& at : Cases()) {
    SCOPED_TRACE(at.name);
    const std::string config = Write("arm.yaml", at.config);
    const Finished checked = RunToEnd({kTaclinkd, "--check-config", "--config", config});
    const bool passes = at.complaint[0] == '\0';
    EXPECT_EQ(checked.exit_code, passes ? 0 : 1) << checked.err;
    EXPECT_THAT(checked.err, HasSubstr(at.complaint));
    EXPECT_EQ(Starts(config), passes);
  }
}

// The server runs without recordings, and says so: a disk that is late keeps no service from starting.
TEST_F(ConfigCheckTest, ItNotesWhatTheServerWouldGoWithout) {
  const std::string config = Write("arm.yaml", With(std::string(kAnyPort) + "events: {audit: file/audit}\n" +
                                                    "recording: {folder: file/logs, at_start: true}\n"));
  const Finished checked = RunToEnd({kTaclinkd, "--check-config", "--config", config});
  EXPECT_EQ(checked.exit_code, 0) << checked.err;
  EXPECT_THAT(checked.err, HasSubstr("note: recording.folder: "));
  EXPECT_THAT(checked.err, HasSubstr("note: events.audit: "));
  EXPECT_TRUE(Starts(config));
}

// Its configuration is being changed, and is as it should be.
TEST_F(ConfigCheckTest, TheServerThatRunsIsNoError) {
  for (const std::string& listen : {std::string("127.0.0.1:0"), "unix:" + Path("socket")}) {
    SCOPED_TRACE(listen);
    Process server({kTaclinkd, "--config", Write("arm.yaml", With(kAnyPort)), "--listen", listen});
    const std::string address = AddressOf(server);
    const Finished checked =
        RunToEnd({kTaclinkd, "--check-config", "--config", Path("arm.yaml"), "--listen", address});
    EXPECT_EQ(checked.exit_code, 0) << checked.err;
    EXPECT_THAT(checked.err, HasSubstr(address + " is in use by another taclinkd (pid " +
                                       std::to_string(server.pid()) + ")"));
    server.Signal(SIGTERM);
    EXPECT_EQ(server.Wait(kStartOrEnd).exit_code, 0);
  }
}

}  // namespace
}  // namespace taclink::testing

// Tokens as a user makes and uses them.
#include <gmock/gmock.h>
#include <signal.h>

#include <iterator>
#include <thread>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

class TokenTest : public ScratchFolder {
 protected:
  struct Made {
    std::string line, token;
  };
  static Made Make(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "token");
    const Finished made = Taclink(arguments);
    EXPECT_EQ(made.exit_code, 0) << made.err;
    return {made.out, made.err.substr(made.err.rfind(' ') + 1, 64)};
  }
  std::string Config(const std::string& more = "") const {
    Write("rest.yaml",
          "taclink_scene: 1\nname: rest\nmodel: cylinder\nskin: linear\nframe_rate_hz: 5\nduration_s: 1\n");
    return Write("arm.yaml",
                 "taclink_config: 1\nhttp: {listen: \"\"}\nsecurity: {tokens: tokens}\n"
                 "events: {audit: audit.jsonl}\n" +
                     more +
                     "arm:\n"
                     "  name: test\n  links:\n"
                     "    - {name: a, model: cylinder, source: simulated, scene: rest.yaml}\n");
  }
  Process Serve() const { return Process({kTaclinkd, "--config", Config(), "--listen", "127.0.0.1:0"}); }
  std::string Read(const std::string& name) const {
    std::ifstream in(Path(name));
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // Waits for it, a minute at most.
  bool IsToldInLog(const std::string& text) const {
    const auto end = std::chrono::steady_clock::now() + seconds(60);
    while (Read("log.txt").find(text) == std::string::npos) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return true;
  }
  unsigned Mode(const std::string& name) const {
    return static_cast<unsigned>(std::filesystem::status(Path(name)).permissions());
  }
};

TEST_F(TokenTest, AMadeTokenLetsIn) {
  const Made made = Make({"otto", "--role", "operator"});
  EXPECT_THAT(made.line, HasSubstr("otto operator "));
  EXPECT_THAT(made.line, Not(HasSubstr(made.token)));
  Write("tokens", made.line);
  Process server = Serve();
  const std::string address = AddressOf(server);
  ASSERT_NE(address, "");
  const Finished refused = Taclink({"list", "--server", address});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("asks for a token"));
  const Finished listed = Taclink({"list", "--server", address, "--token", made.token});
  EXPECT_EQ(listed.exit_code, 0) << listed.err;
  EXPECT_THAT(Taclink({"list", "--server", "192.0.2.1:1", "--token", made.token}).err,
              HasSubstr("in the clear"));
}

TEST_F(TokenTest, AnEmptiedFileLetsNobodyInUntilItIsMendedAndSighupTellsWhatChanged) {
  const Made otto = Make({"otto", "--role", "operator"}), eve = Make({"new", "eve", "--expires", "90d"});
  Write("tokens", otto.line);
  Process server = Serve();
  const std::string address = AddressOf(server);
  ASSERT_NE(address, "");
  Write("tokens", "");
  ASSERT_TRUE(server.ReadUntil("until it is mended", seconds(60), true).has_value());
  EXPECT_THAT(Taclink({"list", "--server", address, "--token", otto.token}).err,
              HasSubstr("token file is in error"));
  Write("tokens", eve.line);
  server.Signal(SIGHUP);
  const auto told = server.ReadUntil("SIGHUP: taken over", seconds(60), true);
  ASSERT_TRUE(told.has_value());
  EXPECT_THAT(*told, ContainsRegex("access: .*added eve \\(viewer, until .*removed otto \\(operator"));
  EXPECT_THAT(*told, Not(HasSubstr(eve.line.substr(eve.line.find("viewer ") + 7, 64)))) << "its hash";
  EXPECT_EQ(Taclink({"list", "--server", address, "--token", eve.token}).exit_code, 0);
  EXPECT_THAT(Taclink({"list", "--server", address, "--token", otto.token}).err, HasSubstr("not known"));
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(seconds(60)).exit_code, 0);
  EXPECT_THAT(Read("audit.jsonl"), AllOf(HasSubstr("\"what\":\"access\""), HasSubstr("holds no token"),
                                         HasSubstr("\"what\":\"configuration\""), HasSubstr("added eve")));
}

TEST_F(TokenTest, FilesAreForOwnerAndGroupWhateverTheUmask) {
  Write("tokens", Make({"otto"}).line);
  Process server({"/bin/sh", "-c", "umask 0; exec \"$0\" --config \"$1\" --listen 127.0.0.1:0 2>\"$2\"",
                  kTaclinkd,
                  Config("log: {file: " + Path("log.txt") + "}\nrecording: {folder: " + Path("logs") +
                         ", at_start: true}\n"),
                  Path("errors")});
  ASSERT_TRUE(IsToldInLog("listening on")) << Read("errors");
  EXPECT_EQ(Mode("log.txt"), 0640U);
  EXPECT_EQ(Mode("logs"), 0750U);
  server.Signal(SIGHUP);  // which is audited
  ASSERT_TRUE(IsToldInLog("SIGHUP: taken over")) << Read("errors");
  server.Signal(SIGTERM);
  server.Wait(seconds(60));
  EXPECT_EQ(Mode("audit.jsonl"), 0640U);
}

TEST_F(TokenTest, NamesAndRolesAreChecked) {
  EXPECT_EQ(Taclink({"token"}).exit_code, 2);
  for (const char* bad : {"a b", "a#b", "a/b", ".a",
                          "\xEF\xBB\xBF"
                          "a"})
    EXPECT_EQ(Taclink({"token", bad}).exit_code, 2) << bad;
  EXPECT_EQ(Taclink({"token", "otto", "--role", "root"}).exit_code, 2);
  EXPECT_EQ(Taclink({"token", "new"}).exit_code, 2);
  EXPECT_EQ(Taclink({"token", "old", "otto"}).exit_code, 2);
  for (const char* bad : {"90", "0d", "-1d", "d", "soon", "2020-01-01", "1e3d"})
    EXPECT_EQ(Taclink({"token", "new", "otto", "--expires", bad}).exit_code, 2) << bad;
  EXPECT_THAT(Make({"new", "otto", "--expires", "2999-01-31"}).line,
              HasSubstr(" expires=2999-01-31T00:00:00Z\n"));
}

}  // namespace
}  // namespace taclink::testing

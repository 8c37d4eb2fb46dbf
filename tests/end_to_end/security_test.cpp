// Tokens as a user makes and uses them.
#include <gmock/gmock.h>

#include "tests/end_to_end/support.h"

namespace taclink::testing {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;
using ::testing::Not;

class TokenTest : public ScratchFolder {};

TEST_F(TokenTest, AMadeTokenLetsIn) {
  const Finished made = Taclink({"token", "otto", "--role", "operator"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("otto operator "));
  const std::string token = made.err.substr(made.err.rfind(' ') + 1, 64);
  EXPECT_THAT(made.out, Not(HasSubstr(token)));
  Write("tokens", made.out);
  Write("rest.yaml",
        "taclink_scene: 1\nname: rest\nmodel: cylinder\nskin: linear\nframe_rate_hz: 5\nduration_s: 1\n");
  const std::string config =
      Write("arm.yaml",
            "taclink_config: 1\nhttp: {listen: \"\"}\nsecurity: {tokens: tokens}\narm:\n"
            "  name: test\n  links:\n"
            "    - {name: a, model: cylinder, source: simulated, scene: rest.yaml}\n");
  Process server({TACLINKD, "--config", config, "--listen", "127.0.0.1:0"});
  const std::string address = AddressOf(server);
  ASSERT_NE(address, "");
  const Finished refused = Taclink({"list", "--server", address});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("asks for a token"));
  const Finished listed = Taclink({"list", "--server", address, "--token", token});
  EXPECT_EQ(listed.exit_code, 0) << listed.err;
  EXPECT_THAT(Taclink({"list", "--server", "192.0.2.1:1", "--token", token}).err, HasSubstr("in the clear"));
}

TEST_F(TokenTest, NamesAndRolesAreChecked) {
  EXPECT_EQ(Taclink({"token"}).exit_code, 2);
  EXPECT_EQ(Taclink({"token", "a b"}).exit_code, 2);
  EXPECT_EQ(Taclink({"token", "otto", "--role", "root"}).exit_code, 2);
}

}  // namespace
}  // namespace taclink::testing

// What the command says and how it exits, for good and for bad input.
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

using CommandTest = ScratchFolder;

void ExpectRefused(const std::vector<std::string>& arguments, int exit_code, const std::string& hint) {
  const Finished run = Taclink(arguments);
  std::string shown;
  for (const auto& word : arguments) shown += word + " ";
  EXPECT_EQ(run.exit_code, exit_code) << shown << run.err;
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << shown << run.err;
  EXPECT_THAT(run.err, HasSubstr(hint)) << shown;
  EXPECT_EQ(run.out, "") << shown;
}

TEST_F(CommandTest, HelpListsCommandsByWhatTheyAreFor) {
  const std::string help = Taclink({"--help"}).out;
  size_t last = 0;
  for (const char* heading : {"Live", "Recordings", "Offline", "Setup"}) {
    const size_t at = help.find(std::string("\n") + heading);
    ASSERT_NE(at, std::string::npos) << heading << "\n" << help;
    EXPECT_GT(at, last) << heading;
    last = at;
  }
  EXPECT_EQ(help.find("Subcommands:"), std::string::npos) << "a command has no heading:\n" << help;
}

TEST_F(CommandTest, ShellsCompleteCommandsAndOptions) {
  const auto words = [](const std::vector<std::string>& before) {
    std::vector<std::string> arguments = {"__complete"};
    arguments.insert(arguments.end(), before.begin(), before.end());
    return Taclink(arguments).out;
  };
  EXPECT_THAT(words({}), AllOf(HasSubstr("watch\n"), HasSubstr("poke\n"), HasSubstr("--version\n")));
  EXPECT_THAT(words({"poke"}), AllOf(HasSubstr("--depth\n"), HasSubstr("--stay\n")));
  EXPECT_THAT(words({"record"}), HasSubstr("start\n"));
  const std::string script = Taclink({"completion", "bash"}).out;
  const std::string line = script + "COMP_WORDS=(taclink poke --dep) COMP_CWORD=2; PATH=" +
                           std::filesystem::path(kTaclink).parent_path().string() +
                           ":$PATH; _taclink; echo ${COMPREPLY[@]}";
  EXPECT_EQ(RunToEnd({"/bin/bash", "-c", line}).out, "--depth\n");
  for (const char* shell : {"zsh", "fish"})
    EXPECT_THAT(Taclink({"completion", shell}).out, HasSubstr("__complete"));
}

TEST_F(CommandTest, TheDoctorSaysWhatIsWellAndWhatMendsTheRest) {
  const Finished run = Taclink({"doctor", "--server", "127.0.0.1:1"});
  EXPECT_THAT(run.out, AllOf(HasSubstr("version"), HasSubstr("disk"), HasSubstr("clock"), HasSubstr("port"),
                             HasSubstr("no server answers at 127.0.0.1:1"), HasSubstr("-> deploy/demo")));
  EXPECT_EQ(run.out.find('\x1b'), std::string::npos) << "no colors into a pipe";
  const Finished bad =
      Taclink({"doctor", "--server", "127.0.0.1:1", "--config", Write("bad.yaml", "arm: 3\n")});
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_THAT(bad.out, HasSubstr("err   configuration"));
}

TEST_F(CommandTest, BadInputGivesOneLineAndAnExitCode) {
  ExpectRefused({}, 2, "subcommand");
  ExpectRefused({"dance"}, 2, "dance");
  ExpectRefused({"wacth"}, 2, "did you mean 'watch'?");
  ExpectRefused({"poke", "--link", "a", "--forse", "1"}, 2, "did you mean '--force'?");
  ExpectRefused({"solve"}, 2, "--model");
  ExpectRefused({"solve", "--model", "cylinder"}, 2, "--markers");
  ExpectRefused({"solve", "--model", "cube", "--markers", "m.csv"}, 1, "shipped model");
  ExpectRefused({"solve", "--model", "cylinder", "--markers", Path("none.csv")}, 1, "none.csv");
  ExpectRefused({"solve", "--model", "cylinder", "--rest", "a.png", "b.png"}, 2, "--images");
  ExpectRefused({"detect", Path("none.png")}, 1, "none.png");
  ExpectRefused({"detect", Write("text.png", "this is no picture")}, 1, "text.png");
  ExpectRefused({"skin", "push", "--model", "cylinder", "--node", "25,5", "--depth-mm", "5"}, 1,
                "paths 1 to 24");
  ExpectRefused({"skin", "push", "--model", "cylinder", "--node", "7,5", "--depth-mm", "30"}, 1, "tube");
  ExpectRefused({"skin", "push", "--model", "cylinder", "--node", "7", "--depth-mm", "5"}, 2, "--node");
  for (const char* gravity : {"unknown", "0,-9.81", "0,0,101"})
    ExpectRefused(
        {"skin", "push", "--model", "cylinder", "--node", "7,5", "--depth-mm", "5", "--gravity", gravity}, 1,
        "'" + std::string(gravity) + "' is not a specific force: give X,Y,Z");
  ExpectRefused({"simulate", "--scene", Path("none.yaml"), "--out", Path("out")}, 1, "none.yaml");
  ExpectRefused({"list", "--server", "127.0.0.1:1"}, 1, "127.0.0.1:1");
}

TEST_F(CommandTest, BadMarkerFilesAreNamedWithTheirLine) {
  const auto refused = [&](const std::string& csv, const std::string& hint) {
    ExpectRefused({"solve", "--model", "cylinder", "--markers", Write("m.csv", csv)}, 1, hint);
  };
  refused("", "fewer than 3");
  refused("path,ring,x,y,z\n1,1,0,0,0\n", "m.csv:1: the header must be");
  refused("path,ring,ux,uy,uz\n1,1,0,0\n", "m.csv:2: expected 5 columns");
  refused("path,ring,ux,uy,uz\n25,1,0,0,0\n", "m.csv:2: no marker (25, 1)");
  refused("path,ring,ux,uy,uz\n1,1,nan,0,0\n", "m.csv:2: displacement 'nan'");
  refused("path,ring,ux,uy,uz\n1,1,0,0,0\n1,1,0,0,0\n", "line 2 already");
}

TEST_F(CommandTest, HelpAndVersionAreNoErrors) {
  EXPECT_EQ(Taclink({"--help"}).exit_code, 0);
  EXPECT_THAT(Taclink({"solve", "--help"}).out, AllOf(HasSubstr("--markers"), HasSubstr("--json")));
  EXPECT_EQ(Taclink({"--version"}).exit_code, 0);
}

TEST_F(CommandTest, DetectFindsTheMarkersOfARealPicture) {
  const Finished run =
      Taclink({"detect", TestData("barrel_real_bottom.jpg"), "--json", "--draw", Path("drawn.png")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto markers = json::parse(run.out).at("markers");
  EXPECT_GE(markers.size(), 230u);
  EXPECT_LE(markers.size(), 260u);
  for (const auto& marker : markers) {
    EXPECT_GT(std::hypot(marker.at("x").get<double>() - 326, marker.at("y").get<double>() - 246), 29);
    EXPECT_GT(marker.at("sigma_px").get<double>(), 0);
    EXPECT_GT(marker.at("width").get<double>(), 0);
  }
  EXPECT_GT(std::filesystem::file_size(Path("drawn.png")), 10000u);
}

TEST_F(CommandTest, SkinPushAnswersWithForceAndInflation) {
  const auto push = [&](const char* force_model, const char* refinement) {
    const Finished run =
        Taclink({"skin", "push", "--model", "cylinder", "--node", "7,5", "--depth-mm", "10", "--pressure-kpa",
                 "0.5", "--force-model", force_model, "--refinement", refinement, "--json"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out);
  };
  const json real = push("nonlinear", "3");
  EXPECT_NEAR(real.at("force_n").get<double>(), 0.59, 0.06);  // measured with a probe
  EXPECT_NEAR(real.at("inflation_mm").get<double>(), 1.5, 0.1);
  EXPECT_NEAR(push("linear", "1").at("force_n").get<double>(), 0.30,
              0.03);  // linear column of the probe table
}

// Path 7 is on top of a link that lies like that.
TEST_F(CommandTest, SkinPushSagsByGravity) {
  const auto push = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"skin",       "push", "--model",      "cylinder", "--node", "7,5",
                                          "--depth-mm", "5",    "--refinement", "1",        "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Finished run = Taclink(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out);
  };
  const json weightless = push({}), lying = push({"--gravity", "0,-9.81,0"});
  EXPECT_EQ(weightless.at("inflation_mm").get<double>(), 0);
  EXPECT_NEAR(lying.at("inflation_mm").get<double>(), -3.6, 0.8);  // as three-dimensional solids
  EXPECT_LT(lying.at("force_n").get<double>(), 0.8 * weightless.at("force_n").get<double>());
}

}  // namespace
}  // namespace taclink::testing

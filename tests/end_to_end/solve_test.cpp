// Numbers of `taclink solve` against the simulation's truth.
#include <gmock/gmock.h>
#include <unistd.h>

#include "sensing/model/model_file.h"
#include "tests/end_to_end/support.h"

namespace taclink::testing {
namespace {

// One push of 0.1 N, pictures with 0.3 px of noise on every marker.
std::string PushScene(const std::string& model, int path, int ring, int seed) {
  return "taclink_scene: 1\nname: push\nmodel: " + model +
         "\nframe_rate_hz: 10\nduration_s: 3\nseed: " + std::to_string(seed) +
         "\ncontacts:\n  - {at: {path: " + std::to_string(path) + ", ring: " + std::to_string(ring) +
         "}, force_n: 0.1, begin_s: 1, end_s: 2.9, ramp_s: 0.2}\ncamera: {marker_jitter_px: 0.3}\n";
}

struct Case {
  std::string model;
  int path, ring;
};

class SolveTest : public ScratchFolder, public ::testing::WithParamInterface<Case> {
 protected:
  // Number of a frame with the push at its full strength, and what is true there.
  std::pair<int, json> Simulate(int seed) {
    const auto& [model, path, ring] = GetParam();
    const std::string scene = Write("scene.yaml", PushScene(model, path, ring, seed));
    const Finished run = Taclink({"simulate", "--scene", scene, "--out", Path("out")});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    std::ifstream lines(Path("out/truth.jsonl"));
    std::string line;
    while (std::getline(lines, line)) {
      json truth = json::parse(line);
      if (truth.at("time_s").get<double>() > 2) return {truth.at("frame").get<int>(), truth};
    }
    ADD_FAILURE() << "no frame later than 2 s";
    return {};
  }

  std::string Picture(const std::string& camera, int frame) const {
    char name[64];
    std::snprintf(name, sizeof name, "out/%s_%06d.png", camera.c_str(), frame);
    return Path(name);
  }

  static json Solve(const std::vector<std::string>& arguments) {
    std::vector<std::string> command = {"solve",          "--model", GetParam().model,
                                        "--pressure-kpa", "0",       "--json"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const Finished run = Taclink(command);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out);
  }

  static void ExpectThePush(const json& solved, const json& truth, double force_tolerance,
                            double center_tolerance_mm) {
    ASSERT_EQ(solved.at("contacts").size(), 1u) << solved.at("contacts");
    const json& contact = solved.at("contacts")[0];
    const json& expected = truth.at("contacts").at(0);
    const Vec3 force = ToVec3(contact.at("force_n")), true_force = ToVec3(expected.at("force_n"));
    EXPECT_NEAR(true_force.norm(), 0.1, 0.002);
    EXPECT_LT((force - true_force).norm(), force_tolerance * true_force.norm());
    EXPECT_LT((ToVec3(contact.at("center_mm")) - ToVec3(expected.at("center_mm"))).norm(),
              center_tolerance_mm);
    EXPECT_NEAR(contact.at("normal_force_n").get<double>(), force.norm(), 0.2 * force.norm());
    EXPECT_NEAR((ToVec3(solved.at("total_force_n")) - force).norm(), 0, 1e-6);
  }
};

TEST_P(SolveTest, PicturesGiveThePushBack) {
  for (const int seed : {1, 2, 3}) {
    const auto [frame, truth] = Simulate(seed);
    const json solved = Solve({"--rest", Path("out/rest_top.png"), Path("out/rest_bottom.png"), "--images",
                               Picture("top", frame), Picture("bottom", frame)});
    SCOPED_TRACE("seed " + std::to_string(seed));
    ExpectThePush(solved, truth, 0.25, 8);
    EXPECT_GT(solved.at("markers").at("seen").get<int>(),
              0.9 * static_cast<double>(solved.at("positions_mm").size()));
    EXPECT_EQ(solved.at("positions_mm").size(), solved.at("nodal_forces_n").size());
    EXPECT_GT(solved.at("time_ms").at("detect").get<double>(), 0);
  }
}

TEST_P(SolveTest, MarkersGiveThePushBack) {
  const auto [frame, truth] = Simulate(5);
  const LinkModel model = LoadLinkModel(GetParam().model).value();
  std::string csv = "path,ring,ux,uy,uz\n";
  const json& u = truth.at("displacements_mm");
  for (int m = 0; m < model.markers.count(); ++m) {
    if (m % 7 == 3) continue;  // some are missing
    csv += std::to_string(model.PathOf(m) + 1) + "," + std::to_string(model.RingOf(m) + 1);
    for (int axis = 0; axis < 3; ++axis)
      csv += "," + u[static_cast<size_t>(m)][static_cast<size_t>(axis)].dump();
    csv += "\n";
  }
  const json solved = Solve({"--markers", Write("markers.csv", csv)});
  ExpectThePush(solved, truth, 0.15, 5);
  EXPECT_EQ(solved.at("markers").at("seen").get<int>() + solved.at("markers").at("inferred").get<int>(),
            model.markers.count());
  EXPECT_EQ(solved.at("force_model"), "nonlinear") << "auto: a dent of some millimetres";
}

// A skin that was inflated before the rest picture looks slack.
TEST_P(SolveTest, APressureThatNobodyTellsIsSaid) {
  Simulate(6);
  const Finished run =
      Taclink({"solve", "--model", GetParam().model, "--json", "--rest", Path("out/rest_top.png"),
               Path("out/rest_bottom.png"), "--images", Picture("top", 5), Picture("bottom", 5)});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, ::testing::HasSubstr("pressure_unknown"));
  const json validity = json::parse(run.out).at("validity");
  EXPECT_EQ(validity.at("status"), "degraded");
  EXPECT_EQ(validity.at("reasons")[0].at("id"), "pressure_unknown");
}

TEST_P(SolveTest, UntouchedSkinHasNoContact) {
  Simulate(6);
  const json solved = Solve({"--rest", Path("out/rest_top.png"), Path("out/rest_bottom.png"), "--images",
                             Picture("top", 5), Picture("bottom", 5)});
  EXPECT_TRUE(solved.at("contacts").empty()) << solved.at("contacts");
}

// Of a single rest pair no scatter is known; how noisy it is shows against a calibration as without one.
TEST_P(SolveTest, UntouchedSkinHasNoContactByACalibration) {
  Simulate(6);
  const std::string top = Path("out/rest_top.png"), bottom = Path("out/rest_bottom.png");
  const Finished run = Taclink(
      {"calibrate", "--model", GetParam().model, "--rest", top, bottom, "--out", Path("calibration.yaml")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json solved = Solve({"--calibration", Path("calibration.yaml"), "--rest", top, bottom, "--images",
                             Picture("top", 5), Picture("bottom", 5)});
  EXPECT_TRUE(solved.at("contacts").empty()) << solved.at("contacts");
  EXPECT_EQ(solved.at("validity").at("status"), "ok") << solved.at("validity");
}

INSTANTIATE_TEST_SUITE_P(Skins, SolveTest,
                         ::testing::Values(Case{"cylinder", 7, 5}, Case{"cylinder", 1, 2},
                                           Case{"cylinder", 18, 8}, Case{"barrel", 4, 8}),
                         [](const auto& one) {
                           return one.param.model + "_" + std::to_string(one.param.path) + "_" +
                                  std::to_string(one.param.ring);
                         });

}  // namespace
}  // namespace taclink::testing

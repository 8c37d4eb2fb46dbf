// `taclink calibrate material` on files, and on pictures that `taclink simulate` made.
#include <gmock/gmock.h>

#include <random>

#include "sensing/model/model_file.h"
#include "tests/end_to_end/support.h"
#include "tests/support/inflated_skin.h"

namespace taclink::testing {
namespace {

using ::testing::HasSubstr;

class MaterialTest : public ScratchFolder {
 protected:
  std::string Markers(const std::string& name, const std::vector<Vec3>& displacements) {
    std::string csv = "path,ring,ux,uy,uz\n";
    for (int m = 0; m < model_.markers.count(); ++m) {
      const Vec3& u = displacements[static_cast<size_t>(m)];
      csv += std::to_string(model_.PathOf(m) + 1) + "," + std::to_string(model_.RingOf(m) + 1);
      for (int axis = 0; axis < 3; ++axis) csv += "," + std::to_string(u[axis]);
      csv += "\n";
    }
    return Write(name, csv);
  }

  // Marker files of a rubber skin of 0.13 MPa with 0.05 mm of noise, at 1 and 1.6 kPa.
  std::vector<std::string> Rubber() {
    std::vector<std::string> words;
    std::mt19937 random(11);
    for (const double kpa : {1.0, 1.6}) {
      const auto exact = InflatedMarkers(model_, {kModulus, 0.5, MaterialLaw::kNeoHookean}, kpa * 1e-3, 2);
      std::vector<Vec3> noisy;
      for (const auto& marker : NoisyRecord(exact, kpa * 1e-3, 0.05, random).markers)
        noisy.push_back(marker.displacement_mm);
      const std::string file = Markers(std::to_string(kpa) + ".csv", noisy);
      words.insert(words.end(), {"--inflation", std::to_string(kpa), file});
    }
    return words;
  }

  static Finished Calibrate(const std::vector<std::string>& more) {
    std::vector<std::string> command = {"calibrate", "material", "--model", "cylinder"};
    command.insert(command.end(), more.begin(), more.end());
    return Taclink(command);
  }

  static std::string Refused(const std::vector<std::string>& more, int code = 1) {
    const Finished run = Calibrate(more);
    EXPECT_EQ(run.exit_code, code) << run.out << run.err;
    EXPECT_EQ(run.out, "");
    return run.err;
  }

  static constexpr double kModulus = 0.13;
  const LinkModel model_ = LoadLinkModel("cylinder").value();
};

TEST_F(MaterialTest, LawAndModulusAreFoundAndWritten) {
  auto words = Rubber();
  words.insert(words.end(), {"--json", "-o", Path("mine.yaml")});
  const Finished run = Calibrate(words);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json found = json::parse(run.out);
  EXPECT_EQ(found.at("law"), "neo_hookean");
  EXPECT_TRUE(found.at("law_decided"));
  const double modulus = found.at("youngs_modulus_mpa"), sigma = found.at("standard_deviation_mpa");
  EXPECT_NEAR(modulus, kModulus, 0.005 * kModulus);
  EXPECT_LT(sigma, 0.005 * kModulus);
  ASSERT_EQ(found.at("laws").size(), 2u);
  EXPECT_EQ(found.at("laws")[0].at("inflation_records").size(), 2u);
  EXPECT_EQ(found.at("laws")[0].at("forces"), nullptr);

  const auto mine = LoadLinkModel(Path("mine.yaml"));
  ASSERT_TRUE(mine.ok()) << mine.error().message;
  EXPECT_EQ(mine->material.law, MaterialLaw::kNeoHookean);
  EXPECT_NEAR(mine->material.youngs_modulus_mpa, modulus, 1e-5 * modulus);
  ASSERT_TRUE(mine->material_evidence.has_value());
  EXPECT_NEAR(mine->material_evidence->sigma_mpa, sigma, 0.01 * sigma);
  EXPECT_THAT(mine->material_evidence->source, HasSubstr("inflation at 1, 1.6 kPa"));
}

TEST_F(MaterialTest, TextTellsOfEveryRecord) {
  auto words = Rubber();
  words.insert(words.end(), {"--law", "neo_hookean"});
  const Finished run = Calibrate(words);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Young's modulus"));
  EXPECT_THAT(run.out, HasSubstr("\u00b1"));
  EXPECT_THAT(run.out, HasSubstr("  1.600      240         0"));
  EXPECT_THAT(run.out, ::testing::Not(HasSubstr("saint_venant")));
}

// The simulation's skin is linear: at a low pressure both laws are, too.
TEST_F(MaterialTest, PicturesOfALowPressureGiveTheSimulationsModulus) {
  const std::string scene = Write("scene.yaml",
                                  "taclink_scene: 1\nname: low\nmodel: cylinder\nframe_rate_hz: 10\n"
                                  "duration_s: 0.5\npressure_keyframes:\n  - {time_s: 0, kpa: 0.3}\n"
                                  "camera: {marker_jitter_px: 0.1}\n");
  ASSERT_EQ(Taclink({"simulate", "--scene", scene, "--out", Path("out")}).exit_code, 0);
  const auto picture = [&](const std::string& name) { return Path("out/" + name + ".png"); };
  const Finished run = Calibrate({"--rest", picture("rest_top"), picture("rest_bottom"), "--pictures", "0.3",
                                  picture("top_000002"), picture("bottom_000002"), "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json found = json::parse(run.out);
  for (const json& law : found.at("laws")) {
    EXPECT_NEAR(law.at("youngs_modulus_mpa").get<double>(), 0.1, 0.01) << law;
    EXPECT_GT(law.at("inflation").at("values").get<int>(), 400);
  }
}

TEST_F(MaterialTest, BadFilesAreNamedWithTheirLine) {
  const std::string head = "j,depth_mm,pressure_kpa,trial,force_n\n";
  const auto probe = [&](const std::string& text) { return Refused({"--probe", Write("forces.csv", text)}); };
  EXPECT_THAT(probe("j,depth_mm,force_n\n5,5,0.1\n"),
              HasSubstr("forces.csv:1: the header has no column 'pressure_kpa'"));
  EXPECT_THAT(probe("# x\n" + head + "5,5,0,1,nan\n"),
              HasSubstr("forces.csv:3: force_n 'nan' is not a finite number"));
  EXPECT_THAT(probe(head + "11,5,0,1,0.1\n"), HasSubstr("forces.csv:2: no ring '11'"));
  EXPECT_THAT(probe(head + "5,5,0,0.1\n"), HasSubstr("forces.csv:2: expected 5 columns"));
  EXPECT_THAT(probe(head + "5,5,0,1,-0.1\n"), HasSubstr("forces.csv:2: the depth must be finite"));
  EXPECT_THAT(probe(head), HasSubstr("holds no row"));
  EXPECT_THAT(Refused({"--probe", Path("none.csv")}), HasSubstr("cannot be read"));
  const auto markers = [&](const std::string& rows, const std::string& kpa = "1") {
    return Refused({"--inflation", kpa, Write("m.csv", "path,ring,ux,uy,uz\n" + rows)});
  };
  EXPECT_THAT(markers("1,1,0,0,nan\n"), HasSubstr("m.csv:2: displacement 'nan'"));
  EXPECT_THAT(markers("25,1,0,0,0\n"), HasSubstr("m.csv:2: no marker (25, 1)"));
  EXPECT_THAT(markers("1,1,1,0,0\n2,1,1,0,0\n3,1,1,0,0\n"), HasSubstr("only 3 markers"));
  EXPECT_THAT(markers("1,1,1,0,0\n", "high"), HasSubstr("'high' is no pressure"));
}

TEST_F(MaterialTest, IncompleteCommandsAreUsageErrors) {
  EXPECT_THAT(Refused({}, 2), HasSubstr("--inflation, --pictures or --probe"));
  EXPECT_THAT(Refused({"--inflation", "1", "a", "2"}, 2), HasSubstr("each time"));
  EXPECT_THAT(Refused({"--pictures", "1", "a", "b"}, 2), HasSubstr("--rest"));
  EXPECT_THAT(Refused({"--probe", "a", "--law", "hooke"}, 2), HasSubstr("hooke"));
  EXPECT_EQ(Taclink({"calibrate", "material", "--probe", "a"}).exit_code, 2);
}

}  // namespace
}  // namespace taclink::testing

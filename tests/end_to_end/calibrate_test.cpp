// `taclink calibrate` on pictures that `taclink simulate` made.
#include <gmock/gmock.h>

#include "sensing/camera/calibration_file.h"
#include "sensing/camera/projection.h"
#include "sensing/capture/image_io.h"
#include "sensing/model/model_file.h"
#include "tests/end_to_end/support.h"

namespace taclink::testing {
namespace {

using ::testing::HasSubstr;

class CalibrateTest : public ScratchFolder {
 protected:
  // Pictures of a link whose top camera is not where the nominal model has it.
  void SetUp() override {
    const auto original = std::string(ShippedModelText("cylinder"));
    const std::string place = "position_mm: [0, 0, -26.5]";
    std::string built = original;
    built.replace(built.find(place), place.size(),
                  "position_mm: [1.2, -1, -25.5]\n    rotation_deg: [1, -1.5, 1]");
    built_ = LoadLinkModel(Write("built.yaml", built)).value();
    const std::string scene = Write("scene.yaml",
                                    "taclink_scene: 1\nname: push\nmodel: cylinder\nframe_rate_hz: 10\n"
                                    "duration_s: 3\ncontacts:\n  - {at: {path: 7, ring: 5}, force_n: 0.1, "
                                    "begin_s: 0.5, end_s: 2.9, ramp_s: 0.2}\n");
    const Finished run =
        Taclink({"simulate", "--scene", scene, "--model", Path("built.yaml"), "--out", Path("out")});
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }

  std::string Picture(const std::string& name) const { return Path("out/" + name + ".png"); }

  Finished Calibrate(const std::vector<std::string>& more, const std::string& top = "rest_top",
                     const std::string& bottom = "rest_bottom") const {
    std::vector<std::string> command = {"calibrate",  "--model",       "cylinder", "--rest",
                                        Picture(top), Picture(bottom), "-o",       Path("rig.yaml")};
    command.insert(command.end(), more.begin(), more.end());
    return Taclink(command);
  }

  LinkModel built_;
};

TEST_F(CalibrateTest, RigIsFoundWrittenAndSolvesWithIt) {
  const Finished run = Calibrate({"--rest", Picture("top_000000"), Picture("bottom_000000"), "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json found = json::parse(run.out);
  EXPECT_EQ(found.at("pairs"), 2);
  EXPECT_EQ(found.at("markers").size(), 240u);
  EXPECT_LT(found.at("rms_px").get<double>(), 0.1);
  EXPECT_LT(found.at("rmse_mm").at("3d").get<double>(), 0.1);
  EXPECT_GT(found.at("cameras").at("top").at("standard_deviations").at("focal_px").get<double>(), 0);

  const auto rig = LoadCalibration(Path("rig.yaml"), LoadLinkModel("cylinder").value());
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  for (const CameraId id : kBothCameras) {
    const Projector is(rig->rig[id]), truth(built_.nominal_rig[id]);
    for (const Vec3& p : built_.RestMarkers()) EXPECT_LT((*is.Project(p) - *truth.Project(p)).norm(), 0.2);
  }

  const Finished solved = Taclink({"solve", "--model", "cylinder", "--json", "--calibration",
                                   Path("rig.yaml"), "--rest", Picture("rest_top"), Picture("rest_bottom"),
                                   "--images", Picture("top_000015"), Picture("bottom_000015")});
  ASSERT_EQ(solved.exit_code, 0) << solved.err;
  const json contacts = json::parse(solved.out).at("contacts");
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_NEAR(ToVec3(contacts[0].at("force_n")).norm(), 0.1, 0.02);
}

TEST_F(CalibrateTest, EveryPairAloneTellsTheScatter) {
  const Finished run =
      Calibrate({"--rest", Picture("top_000002"), Picture("bottom_000002"), "--each", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const json found = json::parse(run.out);
  EXPECT_EQ(found.at("repeats"), 2);
  const json& first = found.at("parameters").at(0);
  EXPECT_EQ(first.at("name"), "position_x");
  EXPECT_GT(first.at("standard_deviation").get<double>(), 0);
  EXPECT_LT(first.at("standard_deviation").get<double>(), 0.2);
  EXPECT_NEAR(first.at("mean").get<double>(), first.at("value").get<double>(), 0.2);
  const Finished table = Calibrate({"--rest", Picture("top_000002"), Picture("bottom_000002"), "--each"});
  EXPECT_THAT(table.out, HasSubstr("over 2 calibrations"));
  const Finished same = Calibrate({"--rest", Picture("rest_top"), Picture("rest_bottom"), "--each"});
  EXPECT_THAT(same.err, HasSubstr("the same images"));
  const Finished one = Calibrate({"--each"});
  EXPECT_THAT(one.err, HasSubstr("give --rest at least twice"));
}

TEST_F(CalibrateTest, TableAndPictureOfResiduals) {
  const Finished run = Calibrate({"--lens", "kannala_brandt"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const char* part : {"lens model kannala_brandt", "RMS, per axis", "phi*R", "focal length", "lens k4"})
    EXPECT_THAT(run.out, HasSubstr(part));
  const auto info = ReadImageInfo(Path("rig.residuals.png"));
  ASSERT_TRUE(info.ok()) << info.error().message;
  EXPECT_GT(info->width_px, 2 * 640);
  const auto rig = LoadCalibration(Path("rig.yaml"), LoadLinkModel("cylinder").value());
  ASSERT_TRUE(rig.ok()) << rig.error().message;
  EXPECT_EQ(rig->rig[CameraId::kTop].lens.kind, LensKind::kKannalaBrandt);
}

TEST_F(CalibrateTest, BadPicturesAreRefusedAndNothingIsWritten) {
  const auto refused = [&](const Finished& run) {
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_FALSE(std::filesystem::exists(Path("rig.yaml")));
    EXPECT_FALSE(std::filesystem::exists(Path("rig.residuals.png")));
    return run.err;
  };
  EXPECT_THAT(refused(Calibrate({}, "rest_bottom", "rest_top")), HasSubstr("look swapped"));
  EXPECT_THAT(refused(Calibrate({}, "top_000015", "bottom_000015")), HasSubstr("touched near path"));
  EXPECT_THAT(refused(Calibrate({}, "rest_top", "missing")), HasSubstr("missing.png"));
  EXPECT_THAT(refused(Taclink({"calibrate", "--model", "barrel", "--rest", Picture("rest_top"),
                               Picture("rest_bottom"), "-o", Path("rig.yaml")})),
              HasSubstr("calibration refused"));
  EXPECT_EQ(
      Taclink({"calibrate", "--model", "cylinder", "--rest", Picture("rest_top"), "-o", Path("rig.yaml")})
          .exit_code,
      2);
}

}  // namespace
}  // namespace taclink::testing

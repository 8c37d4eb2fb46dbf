#include "sensing/camera/calibration_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "sensing/core/utc_time.h"
#include "sensing/model/model_file.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

TEST(CalibrationFile, FilesKeepTheRig) {
  const LinkModel model = LoadLinkModel("barrel").value();
  CalibrationSummary summary;
  summary.rig = LoadLinkModel("barrel")->nominal_rig;
  summary.rig[CameraId::kTop].lens.focal_px = 231.25;
  const TemporaryFolder folder;
  const std::string path = folder / "calibration.yaml";
  ASSERT_TRUE(SaveCalibration(path, CalibrationText(model, summary)).ok());
  const auto loaded = LoadCalibration(path, LoadLinkModel("barrel").value());
  ASSERT_TRUE(loaded.ok()) << loaded.error().message;
  for (const CameraId id : kBothCameras) {
    EXPECT_DOUBLE_EQ(loaded->rig[id].lens.focal_px, summary.rig[id].lens.focal_px);
    EXPECT_LT(
        (loaded->rig[id].camera_from_link.translation - summary.rig[id].camera_from_link.translation).norm(),
        1e-8);
  }
  std::ofstream(path, std::ios::app) << "suprise: 1\n";
  EXPECT_FALSE(LoadCalibration(path, LoadLinkModel("barrel").value()).ok());
  std::filesystem::remove(path);
  EXPECT_EQ(LoadCalibration(path, LoadLinkModel("barrel").value()).error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(SaveCalibration("/nowhere/at/all.yaml", CalibrationText(model, summary)).ok());
}

TEST(CalibrationFile, AFileThatNobodyWaitsForAnyMoreIsNotReplaced) {
  const TemporaryFolder folder;
  const std::string path = folder / "calibration.yaml";
  std::ofstream(path) << "as it was\n";
  bool was_asked_early = false;
  const auto may_replace = [&] {
    const auto entries = std::filesystem::directory_iterator(folder.path());
    was_asked_early = std::distance(begin(entries), end(entries)) != 2;  // the file, and the new one
    return false;
  };
  const auto saved = SaveCalibration(path, "new", may_replace);
  ASSERT_FALSE(saved.ok());
  EXPECT_EQ(saved.error().code, ErrorCode::kUnavailable);
  EXPECT_FALSE(was_asked_early);
  std::string line;
  std::getline(std::ifstream(path), line);
  EXPECT_EQ(line, "as it was");
  const auto entries = std::filesystem::directory_iterator(folder.path());
  EXPECT_EQ(std::distance(begin(entries), end(entries)), 1) << "nothing else is left";
}

TEST(CalibrationFile, FilesKeepTheLensAndItsDeviations) {
  const LinkModel model = LoadLinkModel("barrel").value();
  CalibrationSummary summary;
  summary.rig = model.nominal_rig;
  summary.rig[CameraId::kBottom].lens =
      ConvertLens(model.nominal_rig[CameraId::kBottom].lens, LensKind::kKannalaBrandt, 1);
  for (const CameraId id : kBothCameras) summary.cameras[Index(id)].camera = summary.rig[id];
  summary.covariance = Eigen::MatrixXd::Identity(2 * kCameraParameters, 2 * kCameraParameters);
  const TemporaryFolder folder;
  const std::string path = folder / "calibration.yaml";
  ASSERT_TRUE(SaveCalibration(path, CalibrationText(model, summary)).ok());
  const auto loaded = LoadCalibration(path, model);
  ASSERT_TRUE(loaded.ok()) << loaded.error().message;
  EXPECT_EQ(loaded->rig[CameraId::kTop].lens.kind, LensKind::kDivision);
  EXPECT_EQ(loaded->rig[CameraId::kBottom].lens.kind, LensKind::kKannalaBrandt);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(loaded->rig[CameraId::kBottom].lens.fisheye_k[i],
                summary.rig[CameraId::kBottom].lens.fisheye_k[i], 1e-10);
  }
}

TEST(CalibrationFile, FilesOfVersionOneAreRead) {
  const TemporaryFolder folder;
  const std::string path = folder / "calibration.yaml";
  const std::string camera =
      "{image_size_px: [640, 480], focal_px: 230, principal_point_px: [320, 240], k1_per_px2: 1e-6, "
      "k2_per_px4: 0, position_mm: [0, 0, -4], rotation_deg: [0, 0, 1]}\n";
  const auto load = [&](const std::string& version) {
    std::ofstream(path) << "taclink_calibration: " << version
                        << "\nmodel: barrel\nmarkers_used: 200\nrms_px: 0.3\n"
                        << "cameras:\n  top: " << camera << "  bottom: " << camera;
    return LoadCalibration(path, LoadLinkModel("barrel").value());
  };
  const auto saved = load("1");
  ASSERT_TRUE(saved.ok()) << saved.error().message;
  EXPECT_EQ(saved->rig[CameraId::kTop].lens.kind, LensKind::kDivision);
  EXPECT_EQ(saved->rig[CameraId::kTop].lens.focal_px, 230);
  EXPECT_NE(load("4").error().message.find("taclink_calibration"), std::string::npos);
}

/// A file of the link "left", and what becomes of it elsewhere.
class CalibrationIdentityTest : public ::testing::Test {
 protected:
  CalibrationIdentityTest() {
    CalibrationSummary summary;
    summary.rig = model_.nominal_rig;
    text_ = CalibrationText(model_, summary, left_);
  }
  // Empty: it is taken.
  std::string Refusal(const std::string& text, const CalibrationIdentity& of) const {
    const auto saved = ParseCalibration("left.yaml", text, model_, of);
    return saved ? "" : saved.error().message;
  }
  std::string With(const std::string& from, const std::string& to) const {
    std::string text = text_;
    const size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << text;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const CalibrationIdentity left_{
      .link = "left", .devices = {"serial:A1", "serial:B2"}, .made_utc_s = *ParseUtc("2027-01-31T12:30:00Z")};
  std::string text_;
};

TEST_F(CalibrationIdentityTest, IsReadAsItWasWritten) {
  const auto saved = ParseCalibration("left.yaml", text_, model_, left_);
  ASSERT_TRUE(saved.ok()) << saved.error().message;
  EXPECT_EQ(saved->identity.link, "left");
  EXPECT_EQ(saved->identity.devices, left_.devices);
  EXPECT_EQ(saved->identity.made_utc_s, left_.made_utc_s);
  EXPECT_EQ(Refusal(text_, {}), "") << "whoever asks has no identity";
}

TEST_F(CalibrationIdentityTest, AnotherLinksIsRefusedByName) {
  CalibrationIdentity right = left_;
  right.link = "right";
  EXPECT_THAT(Refusal(text_, right),
              HasSubstr("left.yaml:3: 'link' is 'left', but this is the calibration file of "
                        "link 'right'"));
  // The same link under a new name.
  EXPECT_EQ(Refusal(With("\"left\"", "\"right\""), right), "");
}

TEST_F(CalibrationIdentityTest, OtherCamerasAreRefused) {
  CalibrationIdentity other = left_;
  other.devices = {"serial:B2", "serial:A1"};
  EXPECT_THAT(Refusal(text_, other), HasSubstr("the other way round"));
  other.devices = {"serial:A1", "serial:C3"};
  EXPECT_THAT(Refusal(text_, other),
              HasSubstr("the bottom camera was 'serial:B2', but the link's is 'serial:C3'"));
  other.devices = {"/dev/video0", "/dev/video2"};
  EXPECT_EQ(Refusal(text_, other), "") << "a path does not name a camera";
}

TEST_F(CalibrationIdentityTest, AnotherSkinIsRefused) {
  LinkModel longer = model_;
  for (double& z : longer.markers.rings_z_mm) z += 1;
  const auto saved = ParseCalibration("left.yaml", text_, longer, left_);
  ASSERT_FALSE(saved.ok());
  EXPECT_THAT(saved.error().message, HasSubstr("the markers of model 'cylinder' lie elsewhere"));
  LinkModel softer = model_;
  softer.material.youngs_modulus_mpa *= 0.5;
  EXPECT_TRUE(ParseCalibration("left.yaml", text_, softer, left_).ok()) << "cameras do not see a material";
}

TEST_F(CalibrationIdentityTest, AChangedFileIsRefused) {
  EXPECT_THAT(Refusal(With("focal_px: ", "focal_px: 1"), left_),
              HasSubstr("'hash' is not that of this content"));
  std::string crlf;
  for (const char c : text_) crlf += c == '\n' ? "\r\n" : std::string(1, c);
  EXPECT_EQ(Refusal(crlf, left_), "") << "line ends are no content";
}

}  // namespace
}  // namespace taclink

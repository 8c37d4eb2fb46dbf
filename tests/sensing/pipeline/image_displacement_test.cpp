#include "sensing/pipeline/image_displacement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "sensing/markers/detect/detector.h"
#include "sensing/model/model_file.h"
#include "tests/support/studio.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

class DiagnosisTest : public ::testing::TestWithParam<const char*> {
 protected:
  Detections Spots(const cv::Mat& gray) {
    Detections spots;
    detector_.Detect(gray, spots);
    return spots;
  }
  // `warp`: of the top image.
  std::optional<Reason> Diagnose(const cv::Mat& warp = cv::Mat::eye(2, 3, CV_64F)) {
    cv::Mat top;
    cv::warpAffine(images_[0], top, warp, images_[0].size(), cv::INTER_CUBIC);
    return DiagnoseImages(model_, model_.nominal_rig, model_.RestMarkers(), {Spots(top), Spots(images_[1])});
  }
  std::string Text(const cv::Mat& warp) {
    const auto reason = Diagnose(warp);
    EXPECT_TRUE(!reason || reason->id == ReasonId::kCamerasMoved);
    return reason ? reason->text : "nothing is wrong";
  }
  cv::Mat About(double turn_deg, double scale, double x_px = 0, double y_px = 0) const {
    const cv::Point2f middle(0.5F * static_cast<float>(images_[0].cols - 1),
                             0.5F * static_cast<float>(images_[0].rows - 1));
    cv::Mat by = cv::getRotationMatrix2D(middle, turn_deg, scale);
    by.at<double>(0, 2) += x_px;
    by.at<double>(1, 2) += y_px;
    return by;
  }

  const LinkModel model_ = LoadLinkModel(GetParam()).value();
  const Studio studio_{model_};
  PicturePair images_ = studio_.Take(model_.nominal_rig, studio_.Truth());
  MarkerDetector detector_;
};

TEST_P(DiagnosisTest, NamesWhatHappenedToAnImage) {
  EXPECT_EQ(Text(About(0, 1)), "nothing is wrong");
  EXPECT_THAT(Text(About(5, 1)), HasSubstr("the top camera's image is turned by 5.0 degrees against"));
  EXPECT_THAT(Text(About(90, 1)), HasSubstr("is turned by 90.0 degrees against"));
  EXPECT_THAT(Text(About(180, 1)), HasSubstr("is turned by 180.0 degrees against"));
  EXPECT_THAT(Text(About(0, 1, 6, -4)),
              ::testing::ContainsRegex("is shifted by 6.0, -4.0 px .[0-9.]+ mm of the skin. against"));
  EXPECT_THAT(Text(About(0, 1.06)), ::testing::ContainsRegex("is (5.9|6.0|6.1) % larger against"));
  EXPECT_THAT(Text(About(0, 1, 2, 1)), HasSubstr("is shifted by 2.0, 1.0 px")) << "a knock";
  EXPECT_THAT(Text(About(0.6, 1)), HasSubstr("is turned by 0.6 degrees against"));
  EXPECT_THAT(Text(About(0, 1.012)), ::testing::ContainsRegex("is 1.[123] % larger against"));
  cv::Mat mirror = cv::Mat::eye(2, 3, CV_64F);
  mirror.at<double>(0, 0) = -1;
  mirror.at<double>(0, 2) = images_[0].cols - 1;
  EXPECT_THAT(Text(mirror), HasSubstr("is mirrored against"));
}

TEST_P(DiagnosisTest, TellsSwappedCameras) {
  std::swap(images_[0], images_[1]);
  const auto reason = Diagnose();
  if (model_.name == "barrel") {
    EXPECT_FALSE(reason) << "its nominal cameras are alike";
  } else {
    ASSERT_TRUE(reason);
    EXPECT_EQ(reason->id, ReasonId::kCamerasSwapped);
  }
}

TEST_P(DiagnosisTest, APressedSkinIsNoDisplacement) {
  images_ = studio_.Take(
      model_.nominal_rig,
      studio_.Truth(
          "  - {at: {path: 7, ring: 5}, patch_diameter_mm: 30, depth_mm: 6, begin_s: 0, end_s: 2}\n"));
  EXPECT_FALSE(Diagnose());
  // On the slack skin, a dent of more than a third of the radius.
  images_ = studio_.Take(
      model_.nominal_rig,
      studio_.Truth(
          "  - {at: {path: 7, ring: 5}, patch_diameter_mm: 6, depth_mm: 14, begin_s: 0, end_s: 2}\n"));
  EXPECT_FALSE(Diagnose());
}

TEST_P(DiagnosisTest, WithoutSpotsNothingIsKnown) {
  images_[0].setTo(0);
  EXPECT_FALSE(Diagnose());
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, DiagnosisTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink

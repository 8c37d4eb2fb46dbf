#include "sensing/pipeline/image_contrast.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "sensing/camera/projection.h"
#include "sensing/model/model_file.h"
#include "tests/support/studio.h"

namespace taclink {
namespace {

class ImageContrastTest : public ::testing::Test {
 protected:
  ImageContrastTest() {
    const SkinTruth truth = studio_.Truth();
    gray_ = studio_.Take(model_.nominal_rig, truth)[0];
    const Projector projector(model_.nominal_rig[CameraId::kTop]);
    for (const Vec3& marker_mm : truth.marker_mm) {
      const auto pixel = projector.Project(marker_mm);
      markers_.push_back({.seen = pixel.has_value(), .center_px = pixel.value_or(Vec2::Zero())});
    }
    contrast_.SetRest(gray_, markers_);
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const Studio studio_{model_};
  cv::Mat gray_, changed_;
  std::vector<MarkerObservation> markers_;
  ImageContrast contrast_;
};

TEST_F(ImageContrastTest, HazeAndDarknessTakeTheirPartOfIt) {
  EXPECT_NEAR(contrast_.Of(gray_, markers_).value_or(0), 1, 1e-6);
  gray_.convertTo(changed_, CV_8U, 0.3, 120);
  EXPECT_NEAR(contrast_.Of(changed_, markers_).value_or(0), 0.3, 0.03) << "hazed";
  gray_.convertTo(changed_, CV_8U, 0.5);
  EXPECT_NEAR(contrast_.Of(changed_, markers_).value_or(0), 0.5, 0.03) << "dark";
  cv::GaussianBlur(gray_, changed_, {}, 3);
  EXPECT_LT(contrast_.Of(changed_, markers_).value_or(1), 0.8) << "blurred";
}

TEST_F(ImageContrastTest, ATouchTakesNothing) {
  cv::rectangle(gray_, {0, 0, gray_.cols / 3, gray_.rows}, 0, cv::FILLED);
  const double contrast = contrast_.Of(gray_, markers_).value_or(0);
  EXPECT_NEAR(contrast, 1, 0.05) << "the median is of the markers beside what is covered";
}

TEST_F(ImageContrastTest, IsNotKnownWithoutImagesOrMarkers) {
  EXPECT_FALSE(contrast_.Of({}, markers_));
  EXPECT_FALSE(contrast_.Of(gray_, std::vector<MarkerObservation>(markers_.size())));
  EXPECT_FALSE(ImageContrast().Of(gray_, markers_));
}

}  // namespace
}  // namespace taclink

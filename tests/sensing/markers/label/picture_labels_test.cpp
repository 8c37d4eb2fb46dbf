#include "sensing/markers/label/picture_labels.h"

#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgproc.hpp>
#include <random>
#include <sstream>

#include "sensing/markers/detect/detector.h"
#include "sensing/model/model_file.h"
#include "tests/support/paths.h"
#include "tests/support/read_jpeg.h"

namespace taclink {
namespace {

struct TrueMarker {
  Vec2 center_px;
  int marker = 0;
};

// Places and labels that somebody saw and counted in enlarged crops.
std::vector<TrueMarker> ReadTruth(const LinkModel& model) {
  std::ifstream file(testing::TestData("barrel_real_bottom_markers.csv"));
  std::string line;
  std::getline(file, line);
  std::vector<TrueMarker> truth;
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream numbers(line);
    double x = 0, y = 0;
    int path = 0, ring = 0;
    numbers >> x >> y >> path >> ring;
    truth.push_back({{x, y}, model.MarkerIndex(path - 1, ring - 1)});
  }
  return truth;
}

struct Verdict {
  int labelled = 0, wrong = 0, shown = 0;
  std::string which;  // are wrong
};

// Wrong: nearer to another marker than to its own, or none is there.
Verdict Judge(const std::vector<TrueMarker>& truth, const PictureLabels& labels, const cv::Size& size) {
  Verdict verdict;
  std::vector<Vec2> places(truth.size());
  for (const TrueMarker& t : truth) {
    places[static_cast<size_t>(t.marker)] = t.center_px;
    const Vec2& p = t.center_px;
    verdict.shown += p.x() > 0 && p.y() > 0 && p.x() < size.width - 1 && p.y() < size.height - 1 ? 1 : 0;
  }
  for (const PictureMarker& m : labels.markers) {
    if (places[static_cast<size_t>(m.marker)].x() < -50) continue;  // kNowhere
    const double off = (m.detection.center_px - places[static_cast<size_t>(m.marker)]).norm();
    const double limit = std::max(3.0, 0.3 * std::min(m.detection.width_px, m.detection.height_px));
    const bool nearest = std::none_of(places.begin(), places.end(), [&](const Vec2& place) {
      return (m.detection.center_px - place).norm() < off;
    });
    const bool right = nearest && off < (m.detection.clipped ? 14 : limit);
    ++verdict.labelled;
    if (right) continue;
    ++verdict.wrong;
    std::ostringstream text;
    text << m.marker << " at " << m.detection.center_px.transpose() << ", not "
         << places[static_cast<size_t>(m.marker)].transpose() << "\n";
    verdict.which += text.str();
  }
  return verdict;
}

class RealPictureLabels : public ::testing::Test {
 protected:
  Result<PictureLabels> Label(const cv::Mat& gray) {
    Detections found;
    detector_.Detect(gray, found);
    return LabelPicture(model_, CameraId::kBottom, found, gray);
  }
  // At least that part of the shown markers, none wrong.
  void Expect(const cv::Mat& gray, const std::vector<TrueMarker>& truth, double part) {
    const auto labels = Label(gray);
    ASSERT_TRUE(labels.ok()) << labels.error().message;
    const Verdict verdict = Judge(truth, *labels, gray.size());
    EXPECT_EQ(verdict.wrong, 0) << verdict.which;
    EXPECT_GE(verdict.labelled, part * verdict.shown) << "of " << verdict.shown;
    labelled_ += verdict.labelled;
    wrong_ += verdict.wrong;
    shown_ += verdict.shown;
  }

  MarkerDetector detector_;
  const LinkModel model_ = LoadLinkModel("barrel").value();
  const cv::Mat picture_ = ReadJpegGray(testing::TestData("barrel_real_bottom.jpg"));
  const std::vector<TrueMarker> truth_ = ReadTruth(model_);
  int labelled_ = 0, wrong_ = 0, shown_ = 0;
};

TEST_F(RealPictureLabels, NearlyAllAndNoneWrong) {
  ASSERT_EQ(truth_.size(), 256u);
  Expect(picture_, truth_, 250.0 / 256);
}

const Vec2 kHub(326, 246.5);  // where the paths meet, by eye

// What the picture's edge cuts shows no whole marker, once the picture is moved.
bool IsCut(const Vec2& pixel) {
  return pixel.y() < 25 || pixel.y() > 455;
}
const Vec2 kNowhere(-100, -100);

TEST_F(RealPictureLabels, TurnedByPathPitches) {
  for (const int pitches : {-5, -1, 2, 8}) {
    SCOPED_TRACE(pitches);
    const double degrees = 360.0 / 16 * pitches;
    const cv::Point2f hub(static_cast<float>(kHub.x()), static_cast<float>(kHub.y()));
    const cv::Mat turn = cv::getRotationMatrix2D(hub, degrees, 1);
    cv::Mat turned;
    cv::warpAffine(picture_, turned, turn, picture_.size(), cv::INTER_CUBIC);
    std::vector<TrueMarker> truth = truth_;
    for (TrueMarker& t : truth) {
      const Vec2 p = t.center_px;
      t.center_px =
          Vec2(turn.at<double>(0, 0) * p.x() + turn.at<double>(0, 1) * p.y() + turn.at<double>(0, 2),
               turn.at<double>(1, 0) * p.x() + turn.at<double>(1, 1) * p.y() + turn.at<double>(1, 2));
      // Positive angles turn anticlockwise as the eye sees it, and so do the bottom camera's paths.
      if (IsCut(p)) t.center_px = kNowhere;
      t.marker = model_.MarkerIndex((model_.PathOf(t.marker) + pitches + 16) % 16, model_.RingOf(t.marker));
    }
    Expect(turned, truth, 0.9);
  }
}

TEST_F(RealPictureLabels, OtherLight) {
  cv::Mat gray;
  for (const double gain : {0.35, 0.6, 1.5}) {
    SCOPED_TRACE(gain);
    picture_.convertTo(gray, CV_8U, gain);
    Expect(gray, truth_, 0.9);
  }
  for (const double blur : {0.7, 1.0}) {
    SCOPED_TRACE(blur);
    cv::GaussianBlur(picture_, gray, {}, blur);
    Expect(gray, truth_, 0.75);
  }
  for (const double sigma : {4.0, 8.0}) {
    SCOPED_TRACE(sigma);
    cv::Mat noise(picture_.size(), CV_16S), noisy;
    cv::theRNG().state = 7;
    cv::randn(noise, 0, sigma);
    picture_.convertTo(noisy, CV_16S);
    cv::Mat(noisy + noise).convertTo(gray, CV_8U);
    Expect(gray, truth_, 0.8);
  }
}

cv::Mat Warped(const cv::Mat& picture, double degrees, double scale, std::vector<TrueMarker>& truth) {
  const cv::Point2f hub(static_cast<float>(kHub.x()), static_cast<float>(kHub.y()));
  const cv::Mat by = cv::getRotationMatrix2D(hub, degrees, scale);
  cv::Mat warped;
  cv::warpAffine(picture, warped, by, picture.size(), cv::INTER_CUBIC);
  for (TrueMarker& t : truth) {
    const Vec2 p = t.center_px;
    t.center_px = IsCut(p)
                      ? kNowhere
                      : Vec2(by.at<double>(0, 0) * p.x() + by.at<double>(0, 1) * p.y() + by.at<double>(0, 2),
                             by.at<double>(1, 0) * p.x() + by.at<double>(1, 1) * p.y() + by.at<double>(1, 2));
  }
  return warped;
}

// From the hub to the rim. A spot that its edge cuts has its center elsewhere.
cv::Mat WithStrip(const cv::Mat& picture, double degrees, int width_px, int level,
                  std::vector<TrueMarker>& truth) {
  constexpr double kLargestSpotPx = 36;
  cv::Mat covered = picture.clone();
  const Vec2 along(std::cos(RadFromDeg(degrees)), std::sin(RadFromDeg(degrees)));
  for (TrueMarker& t : truth) {
    const Vec2 at = t.center_px - kHub;
    const double across = std::abs(at.x() * along.y() - at.y() * along.x());
    if (at.dot(along) > 0 && across < 0.5 * (width_px + kLargestSpotPx)) t.center_px = kNowhere;
  }
  const Vec2 end = kHub + 500 * along;
  cv::line(covered, cv::Point(cvRound(kHub.x()), cvRound(kHub.y())),
           cv::Point(cvRound(end.x()), cvRound(end.y())), cv::Scalar(level), width_px);
  return covered;
}

// Whatever happens to a real image: what is labeled is labeled rightly, or nothing is.
TEST_F(RealPictureLabels, DisturbedCopiesAreRightOrRefused) {
  int copies = 0, refused = 0;
  const auto check = [&](const std::string& what, const cv::Mat& gray, const std::vector<TrueMarker>& truth) {
    SCOPED_TRACE(what);
    ++copies;
    const auto labels = Label(gray);
    if (!labels) {
      ++refused;
      return;
    }
    const Verdict verdict = Judge(truth, *labels, gray.size());
    EXPECT_EQ(verdict.wrong, 0) << verdict.which;
  };
  for (const double scale : {0.8, 0.9, 0.98, 1.02, 1.1, 1.25}) {
    std::vector<TrueMarker> truth = truth_;
    const cv::Mat warped = Warped(picture_, 0, scale, truth);
    check("scaled by " + std::to_string(scale), warped, truth);
  }
  for (const double degrees : {-8.0, -3.0, 2.0, 5.0}) {
    std::vector<TrueMarker> truth = truth_;
    const cv::Mat warped = Warped(picture_, degrees, 1, truth);
    check("rolled by " + std::to_string(degrees), warped, truth);
  }
  for (const int level : {0, 255}) {
    for (const double degrees : {0.0, 80.0, 200.0}) {
      for (const int width_px : {20, 60}) {
        std::vector<TrueMarker> truth = truth_;
        const cv::Mat covered = WithStrip(picture_, degrees, width_px, level, truth);
        check("strip " + std::to_string(level) + " at " + std::to_string(degrees), covered, truth);
      }
    }
  }
  cv::Mat gray;
  for (const double blur : {1.5, 2.0, 3.0}) {
    cv::GaussianBlur(picture_, gray, {}, blur);
    check("blurred by " + std::to_string(blur), gray, truth_);
  }
  for (const double sigma : {12.0, 20.0, 40.0}) {
    cv::Mat noise(picture_.size(), CV_16S), noisy;
    cv::theRNG().state = 7;
    cv::randn(noise, 0, sigma);
    picture_.convertTo(noisy, CV_16S);
    cv::Mat(noisy + noise).convertTo(gray, CV_8U);
    check("noise of " + std::to_string(sigma), gray, truth_);
  }
  picture_.convertTo(gray, CV_8U, 0.3, 120);
  check("hazed", gray, truth_);
  gray = picture_.clone();
  gray.colRange(0, gray.cols / 2) = 0;
  check("half covered", gray, truth_);
  std::printf("%d of %d disturbed copies are refused\n", refused, copies);
  EXPECT_LT(refused, copies / 2);
}

/// A dent as it looks: points move towards the hub, most in its middle.
struct PictureDent {
  double angle = 0, log_radius = 0, depth = 0;  // of log radius
  double angle_width = 0.5, radius_width = 0.3;
};

double Moved(const std::vector<PictureDent>& dents, double angle, double log_radius) {
  double moved = log_radius;
  for (const PictureDent& d : dents) {
    const double a = std::remainder(angle - d.angle, 2 * kPi) / d.angle_width;
    const double r = (log_radius - d.log_radius) / d.radius_width;
    moved -= d.depth * std::exp(-0.5 * (a * a + r * r));
  }
  return moved;
}

cv::Mat Dented(const cv::Mat& picture, const std::vector<PictureDent>& dents) {
  cv::Mat map(picture.size(), CV_32FC2), dented;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const Vec2 at = Vec2(x, y) - kHub;
      const double angle = std::atan2(at.y(), at.x()), wanted = std::log(std::max(at.norm(), 1.0));
      double from = wanted;
      for (int i = 0; i < 12; ++i) from += wanted - Moved(dents, angle, from);
      const Vec2 p = kHub + std::exp(from) * Vec2(std::cos(angle), std::sin(angle));
      map.at<cv::Vec2f>(y, x) = {static_cast<float>(p.x()), static_cast<float>(p.y())};
    }
  }
  cv::remap(picture, dented, map, {}, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return dented;
}

TEST_F(RealPictureLabels, TouchedSkin) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int trial = 0; trial < 40; ++trial) {
    SCOPED_TRACE(trial);
    std::vector<PictureDent> dents;
    for (int i = 0; i <= trial % 3; ++i) {
      PictureDent d{2 * kPi * uniform(random), 3.7 + 1.6 * uniform(random), 0, 0.35 + 0.3 * uniform(random)};
      d.depth = (trial % 4 == 3 ? -0.1 : 0.18) * (0.4 + 0.6 * uniform(random));
      dents.push_back(d);
    }
    std::vector<TrueMarker> truth = truth_;
    for (TrueMarker& t : truth) {
      if (IsCut(t.center_px)) {
        t.center_px = kNowhere;
        continue;
      }
      const Vec2 at = t.center_px - kHub;
      const double angle = std::atan2(at.y(), at.x());
      t.center_px = kHub + std::exp(Moved(dents, angle, std::log(at.norm()))) * at.normalized();
    }
    Expect(Dented(picture_, dents), truth, 0.7);
  }
  EXPECT_GE(labelled_, 0.92 * shown_);
  RecordProperty("labelled", labelled_);
  RecordProperty("shown", shown_);
}

}  // namespace
}  // namespace taclink

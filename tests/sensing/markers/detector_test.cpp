#include "sensing/markers/detector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>
#include <string>

#include "tests/support/read_jpeg.h"

namespace taclink {
namespace {

struct Ellipse {
  Vec2 center;
  double a, b, angle, gray;
};

// Anti-aliased by 8 x 8 samples a pixel, on an uneven background, slightly blurred by the sampling, with
// noise.
cv::Mat Draw(int width, int height, const std::vector<Ellipse>& ellipses, double noise, unsigned seed) {
  constexpr int kSamples = 8;
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss(0, noise);
  cv::Mat picture(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double background = 10 + 15.0 * x / width;
      double gray = background;
      for (const Ellipse& e : ellipses) {
        if (std::hypot(x - e.center.x(), y - e.center.y()) > std::max(e.a, e.b) + 2) continue;
        int inside = 0;
        for (int s = 0; s < kSamples * kSamples; ++s) {
          const Vec2 p(x - 0.5 + (s % kSamples + 0.5) / kSamples, y - 0.5 + (s / kSamples + 0.5) / kSamples);
          const Vec2 q = Eigen::Rotation2Dd(-e.angle) * (p - e.center);
          inside += std::pow(q.x() / e.a, 2) + std::pow(q.y() / e.b, 2) <= 1 ? 1 : 0;
        }
        gray += (e.gray - background) * inside / (kSamples * kSamples);
      }
      picture.at<uint8_t>(y, x) =
          static_cast<uint8_t>(std::clamp(std::lround(gray + gauss(random)), 0L, 255L));
    }
  }
  return picture;
}

const Detection* Nearest(const Detections& found, const Vec2& at, double within) {
  const Detection* best = nullptr;
  for (const Detection& d : found) {
    const double distance = (d.center_px - at).norm();
    if (distance <= within) best = &d, within = distance;
  }
  return best;
}

TEST(Detector, CentresOfEllipsesAreSubPixelAtAnySize) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  double squares = 0, normalised = 0;
  int count = 0;
  for (unsigned trial = 0; trial < 6; ++trial) {
    std::vector<Ellipse> ellipses;
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 8; ++column) {
        const double longest = 2 + 13 * uniform(random);  // semi-axis: 4 to 30 px across
        const double shortest = std::max(2.0, longest * (0.6 + 0.4 * uniform(random)));
        ellipses.push_back({Vec2(40 + 75 * column + uniform(random), 45 + 75 * row + uniform(random)),
                            longest, shortest, kPi * uniform(random), 90 + 120 * uniform(random)});
      }
    }
    MarkerDetector detector;
    Detections found;
    detector.Detect(Draw(640, 480, ellipses, 2, trial), found);
    EXPECT_EQ(found.size(), ellipses.size());
    EXPECT_NEAR(detector.noise(), 2, 0.4);
    for (const Ellipse& e : ellipses) {
      const Detection* d = Nearest(found, e.center, 1);
      ASSERT_NE(d, nullptr) << e.center.transpose() << " size " << e.a << " x " << e.b;
      const double error = (d->center_px - e.center).norm();
      EXPECT_LT(error, 0.15) << "size " << e.a << " x " << e.b;
      EXPECT_FALSE(d->clipped);
      EXPECT_NEAR(d->area_px2, kPi * e.a * e.b, 0.25 * kPi * e.a * e.b);
      squares += error * error;
      normalised += error * error / d->covariance_px2.trace();
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(squares / count / 2), 0.05);
  // The stated sigma is neither boastful nor useless.
  EXPECT_GT(normalised / count, 0.1);
  EXPECT_LT(normalised / count, 2);
}

TEST(Detector, DimFarMarkersTwoPixelsApartAreParted) {
  std::vector<Ellipse> ellipses;
  for (int i = 0; i < 12; ++i) {
    for (int row = 0; row < 5; ++row)
      ellipses.push_back({Vec2(60.3 + 5.4 * i, 40.6 + 12 * row), 1.7, 2.6, 0, 45.0 + 3 * row});
  }
  MarkerDetector detector;
  Detections found;
  detector.Detect(Draw(200, 120, ellipses, 1.5, 1), found);
  int hits = 0;
  for (const Ellipse& e : ellipses) hits += Nearest(found, e.center, 0.6) != nullptr ? 1 : 0;
  EXPECT_GE(hits, 57);
  EXPECT_LE(found.size(), ellipses.size());
}

TEST(Detector, WhatIsNoBlobIsLeftOut) {
  // A ring, a bright border along a side, noise.
  cv::Mat picture = Draw(320, 240, {{Vec2(160, 120), 30, 30, 0, 230}}, 3, 5);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      if (std::hypot(x - 160, y - 120) < 27) picture.at<uint8_t>(y, x) = 5;
      if (x + y < 60) picture.at<uint8_t>(y, x) = 240;
    }
  }
  MarkerDetector detector;
  Detections found;
  detector.Detect(picture, found);
  EXPECT_TRUE(found.empty()) << found.front().center_px.transpose();
}

TEST(Detector, ABlobAtTheEdgeSaysSo) {
  MarkerDetector detector;
  Detections found;
  detector.Detect(Draw(320, 240, {{Vec2(100, 2), 12, 9, 0, 200}, {Vec2(200, 100), 12, 9, 0, 200}}, 2, 6),
                  found);
  ASSERT_EQ(found.size(), 2u);
  const Detection* clipped = Nearest(found, Vec2(100, 4), 4);
  ASSERT_NE(clipped, nullptr);
  EXPECT_TRUE(clipped->clipped);
  EXPECT_GT(clipped->sigma_px(), 1);
}

TEST(Detector, OddPicturesGiveNothing) {
  MarkerDetector detector;
  Detections found(3);
  detector.Detect(cv::Mat(), found);
  EXPECT_TRUE(found.empty());
  detector.Detect(cv::Mat(100, 100, CV_8UC3, cv::Scalar(1, 2, 3)), found);
  EXPECT_TRUE(found.empty());
  for (const int gray : {0, 128, 255}) {
    detector.Detect(cv::Mat(101, 103, CV_8UC1, cv::Scalar(gray)), found);
    EXPECT_TRUE(found.empty());
  }
}

std::vector<Vec2> ReadPoints(const std::string& name) {
  std::ifstream file(std::string(TACLINK_TEST_DATA) + "/" + name);
  std::vector<Vec2> points;
  for (std::string line; std::getline(file, line);) {
    double x = 0, y = 0;
    if (std::sscanf(line.c_str(), "%lf,%lf", &x, &y) == 2) points.emplace_back(x, y);
  }
  return points;
}

TEST(Detector, RealPictureAgainstMarkersFoundByEye) {
  const auto truth = ReadPoints("barrel_real_bottom_markers.csv");
  ASSERT_EQ(truth.size(), 256u);
  MarkerDetector detector;
  Detections found;
  detector.Detect(ReadJpegGray(std::string(TACLINK_TEST_DATA) + "/barrel_real_bottom.jpg"), found);
  int hits = 0;
  for (const Vec2& marker : truth) hits += Nearest(found, marker, 2.5) != nullptr ? 1 : 0;
  int wrong = 0;
  for (const Detection& d : found) {
    const bool real = std::any_of(truth.begin(), truth.end(), [&](const Vec2& t) {
      return (t - d.center_px).norm() < std::max(2.5, d.width_px / 3);
    });
    wrong += real ? 0 : 1;
    EXPECT_GT((d.center_px - Vec2(324.5, 244.5)).norm(), 30) << "in the LED ring";
  }
  EXPECT_GE(hits, 230);
  EXPECT_LE(wrong, 4);
  RecordProperty("found", hits);
  RecordProperty("wrong", wrong);
}

TEST(Detector, SimulatedPictures) {
  for (const char* name : {"/barrel_simulated_top.jpg", "/barrel_simulated_bottom.jpg"}) {
    MarkerDetector detector;
    Detections found;
    detector.Detect(ReadJpegGray(std::string(TACLINK_TEST_DATA) + name), found);
    // 256 discs, and a jagged rim of which some bits look like dim ones.
    const auto bright =
        std::count_if(found.begin(), found.end(), [](const Detection& d) { return d.area_px2 > 7; });
    EXPECT_GE(bright, 250) << name;
    EXPECT_LE(found.size(), 264u) << name;
  }
}

}  // namespace
}  // namespace taclink
